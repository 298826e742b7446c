"""Improve a cloned policy by PPO (Schulman et al. 2017) of Stable-Baselines3.

    pip install 'bluntdissect[dataset]' stable-baselines3
    bluntdissect dataset -o window/ --seeds 1-20 --tremor 0.1
    python examples/refine_window.py window/ --minutes 20

The network of `clone_window.py` is where the policy begins. Its critic learns alone at first: what
it does not know yet would undo what the clone can. Then both learn, on beds 1 to 20, where an error
costs as much as half a pass. What comes out is judged on beds never seen.
"""

import time
from pathlib import Path

import gymnasium
import numpy as np
from clone_window import KEYS, TIME_LIMIT_S, Network, arguments, demonstrations, judge

from app.rl.environment import DissectionEnv

try:
    import torch  # pyright: ignore[reportMissingImports]  # not among what tests need
    from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.callbacks import (  # pyright: ignore[reportMissingImports]
        BaseCallback,
    )
    from stable_baselines3.common.env_util import (  # pyright: ignore[reportMissingImports]
        make_vec_env,
    )
except ImportError:
    raise SystemExit(
        "refine_window.py needs Stable-Baselines3: pip install stable-baselines3"
    ) from None

ENVS, STEPS, CRITIC_STEPS, NOISE = 8, 512, 12_288, 0.08
REWARD = {"time": -0.1, "errors": -0.5, "stress": 0.0}


class Row(gymnasium.ObservationWrapper):
    """What the network of the clone sees: one row, scaled, without the time left."""

    def __init__(self, network: Network) -> None:
        super().__init__(DissectionEnv(time_limit=TIME_LIMIT_S, reward=REWARD))
        self._network = network
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, network.mean.shape)

    def observation(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        row = np.concatenate([observation[key].ravel() for key in KEYS])[:-1]
        return ((row - self._network.mean) / self._network.scale).astype(np.float32)


class Watch(BaseCallback):
    """Ends the training in time, and prints how it goes."""

    def __init__(self, until: float) -> None:
        super().__init__()
        self._until = until

    def _on_step(self) -> bool:
        return time.monotonic() < self._until

    def _on_rollout_end(self) -> None:
        ended = self.model.ep_info_buffer
        earned, length = (np.mean([each[key] for each in ended]) for key in "rl")
        print(f"{self.num_timesteps} steps: {earned:.2f} and {length:.0f} steps a bed", flush=True)


def layers_of(model: PPO) -> list[torch.nn.Linear]:
    """The layers of the policy, in order."""
    hidden = [each for each in model.policy.mlp_extractor.policy_net if hasattr(each, "weight")]
    return [*hidden, model.policy.action_net]


def main() -> None:
    parser = arguments("Improve a cloned policy by PPO, and judge it.")
    parser.add_argument("--minutes", type=float, default=20.0)
    given = parser.parse_args()
    network = Network(*demonstrations(given.folder))
    judge("clone", network.act)
    model = PPO(
        "MlpPolicy",
        make_vec_env(lambda: Row(network), n_envs=ENVS, seed=1),
        learning_rate=1e-4,
        n_steps=STEPS,
        batch_size=512,
        n_epochs=5,
        clip_range=0.1,
        target_kl=0.01,
        seed=1,
        device="cpu",
        policy_kwargs={"net_arch": [len(each[0]) for each in network.layers[:-1]]},
    )
    own = [model.policy.log_std]
    with torch.no_grad():
        model.policy.log_std.fill_(float(np.log(NOISE)))
        for theirs, ours in zip(layers_of(model), network.layers, strict=True):
            theirs.weight.copy_(torch.from_numpy(ours[:-1].T))
            theirs.bias.copy_(torch.from_numpy(ours[-1]))
            own += [theirs.weight, theirs.bias]
    until = time.monotonic() + 60.0 * given.minutes
    for each in own:
        each.requires_grad_(False)
    model.learn(CRITIC_STEPS, callback=Watch(until))
    for each in own:
        each.requires_grad_(True)
    model.learn(10**9, callback=Watch(until), reset_num_timesteps=False)
    with torch.no_grad():
        network.layers = [
            np.concatenate([each.weight.numpy().T, each.bias.numpy()[None]]).astype(np.float64)
            for each in layers_of(model)
        ]
    network.save(Path("refine.onnx"))
    judge("refine", network.act)


if __name__ == "__main__":
    main()
