"""The messages of Haply's Inverse service, versions 3.1 and 3.5, as its pages publish them.

Source: docs.haply.co, Inverse SDK, service: *WebSocket Protocol*, *Control Commands*, *JSON
Conventions* and the tutorials. The service sends an inventory on connection (device, config, state
and status) and then exactly one state for each message that it gets; a force or position holds for
one message, a session's profile is sent once. Version 3.1 calls a force ``values``, version 3.5
``vector`` and names the session in every message. Units are m, m/s, N and degrees; x is to the
right, y forward and z up.
"""

import math
from typing import Literal
from urllib.parse import urlsplit

import msgspec
from msgspec import UNSET, Struct, UnsetType, field

Version = Literal["3.1", "3.5"]


class ProtocolError(ValueError):
    """A message that the published protocol does not have."""


def websocket_address(address: str) -> tuple[str, int]:
    """Return host and port of an address like ws://127.0.0.1:10001."""
    url = urlsplit(address)
    try:
        port = url.port
    except ValueError:
        port = None
    if url.scheme != "ws" or not url.hostname or port is None:
        raise ValueError(f"--address must be like ws://127.0.0.1:10001, not {address}")
    return url.hostname, port


class Vector(Struct):
    """x, y and z; what is left out is zero."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @property
    def finite(self) -> bool:
        """Whether all three are numbers."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.z)


class _Scale(Struct):
    x: float = 1.0
    y: float = 1.0
    z: float = 1.0


class Quaternion(Struct):
    """A rotation; the identity when left out."""

    w: float = 1.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Angles(Struct):
    """One figure for each of the three joints."""

    a0: float = 0.0
    a1: float = 0.0
    a2: float = 0.0


class _Transform(Struct):
    position: Vector = field(default_factory=Vector)
    rotation: Quaternion = field(default_factory=Quaternion)
    scale: _Scale = field(default_factory=_Scale)


class _DeviceInfo(Struct):
    major_version: int = 7
    minor_version: int = 4
    id: str = ""
    device_type: int | UnsetType = UNSET
    model: int | UnsetType = UNSET
    uuid: str = ""


class _Gravity(Struct):
    enabled: bool = True
    scaling_factor: float = 1.0


class _Switch(Struct):
    enabled: bool = False


class _Basis(Struct):
    permutation: str = "XYZ"


class _ForceGate(Struct):
    gain: float = 0.3


class _Damping(Struct):
    scalar: float = 0.0


class _Filters(Struct):
    force_gate: _ForceGate = field(default_factory=_ForceGate)
    damping: _Damping = field(default_factory=_Damping)


class InverseConfig(Struct):
    """Configuration of an Inverse3 in the inventory; version 3.1 ends with `torque_scaling`."""

    type: str = "inverse3"
    port: str = ""
    device_info: _DeviceInfo = field(default_factory=_DeviceInfo)
    extended_device_id: str = ""
    extended_firmware_version: str = ""
    gravity_compensation: _Gravity = field(default_factory=_Gravity)
    handedness: str = "right"
    streaming_mode: str | UnsetType = UNSET
    torque_scaling: _Switch = field(default_factory=lambda: _Switch(True))
    home_return: _Switch | UnsetType = UNSET
    preset: str | UnsetType = UNSET
    basis: _Basis | UnsetType = UNSET
    mount: _Transform | UnsetType = UNSET
    filters: _Filters | UnsetType = UNSET

    @classmethod
    def simulated(cls, device_id: str, version: Version, preset: str) -> "InverseConfig":
        """Return the configuration of a simulated device."""
        config = cls(port="simulated", extended_device_id=device_id)
        config.device_info.id = device_id
        if version == "3.1":
            config.device_info.model = 4
            return config
        config.device_info.device_type = 4
        config.streaming_mode, config.home_return = "USB", _Switch()
        config.preset, config.basis = preset, _Basis()
        config.mount, config.filters = _Transform(), _Filters()
        return config


class InverseState(Struct):
    """Where the cursor of an Inverse3 is, and what drives it.

    `mode` is of version 3.1, which leaves out what comes between the cursor's speed and it.
    """

    cursor_position: Vector
    cursor_velocity: Vector = field(default_factory=Vector)
    angular_position: Angles = field(default_factory=Angles)
    angular_velocity: Angles = field(default_factory=Angles)
    body_orientation: Quaternion = field(default_factory=Quaternion)
    current_cursor_force: Vector | UnsetType = UNSET
    current_cursor_position: Vector | UnsetType = UNSET
    current_angular_torques: Angles | UnsetType = UNSET
    current_angular_position: Angles | UnsetType = UNSET
    control_domain: str | UnsetType = UNSET
    control_mode: str | UnsetType = UNSET
    transform: _Transform | UnsetType = UNSET
    mode: str | UnsetType = UNSET

    def driven(self, force: Vector, place: Vector | None, acting: Vector) -> "InverseState":
        """Return the state as version 3.5 has it."""
        idle = force == Vector() and place is None
        mode = "position" if place is not None else "force"
        return InverseState(
            self.cursor_position,
            self.cursor_velocity,
            current_cursor_force=acting,
            current_cursor_position=place or Vector(),
            current_angular_torques=Angles(),
            current_angular_position=Angles(),
            control_domain="undefined" if idle else "cartesian",
            control_mode="idle" if idle else mode,
            transform=_Transform(),
        )


class InverseStatus(Struct):
    """Whether an Inverse3 can be used."""

    calibrated: bool = True
    in_use: bool = False
    power_supply: bool = True
    ready: bool = True
    started: bool = True


class Inverse(Struct):
    """An Inverse3; its config comes with the inventory only."""

    device_id: str
    config: InverseConfig | UnsetType = UNSET
    state: InverseState | UnsetType = UNSET
    status: InverseStatus | UnsetType = UNSET


class _Buttons(Struct):
    a: bool = False
    b: bool = False
    c: bool = False


class GripState(Struct):
    """Orientation and buttons of a VerseGrip."""

    orientation: Quaternion = field(default_factory=Quaternion)
    buttons: _Buttons = field(default_factory=_Buttons)
    hall: int = 0
    battery_level: float = 1.0

    @property
    def pressed(self) -> int:
        """The buttons as bits: 1 for a, 2 for b, 4 for c."""
        return self.buttons.a | self.buttons.b << 1 | self.buttons.c << 2

    @classmethod
    def with_pressed(cls, bits: int) -> "GripState":
        """Return the state of a grip that lies still with some buttons pressed."""
        return cls(buttons=_Buttons(bool(bits & 1), bool(bits & 2), bool(bits & 4)))


class _GripConfig(Struct):
    type: str = "wireless_verse_grip"


class _GripStatus(Struct):
    connected: bool = True
    ready: bool = True


class Grip(Struct):
    """A wireless VerseGrip."""

    device_id: str
    config: _GripConfig | UnsetType = UNSET
    state: GripState | UnsetType = UNSET
    status: _GripStatus | UnsetType = UNSET

    def introduced(self) -> "Grip":
        """Return it as the inventory has it."""
        return Grip(self.device_id, _GripConfig(), self.state, self.status)


class _WiredState(Struct):
    button: bool = False
    hall: int = 0
    orientation: Quaternion = field(default_factory=Quaternion)


class WiredGrip(Struct):
    """A VerseGrip on a cable, with one button."""

    device_id: str
    state: _WiredState | UnsetType = UNSET


class ServiceMessage(Struct):
    """An inventory or a state: what the service sends."""

    session_id: int | UnsetType = UNSET
    inverse3: list[Inverse] = field(default_factory=list[Inverse])
    wireless_verse_grip: list[Grip] = field(default_factory=list[Grip])
    verse_grip: list[WiredGrip] | UnsetType = UNSET


class ForceCommand(Struct):
    """A force on the cursor, N; `values` is of version 3.1, `vector` of 3.5."""

    vector: Vector | UnsetType = UNSET
    values: Vector | UnsetType = UNSET

    @property
    def force(self) -> Vector | UnsetType:
        """The force by whichever name."""
        return self.values if self.vector is UNSET else self.vector


class PositionCommand(Struct):
    """A target of the cursor, m; `values` is of version 3.1, `position` of 3.5."""

    position: Vector | UnsetType = UNSET
    values: Vector | UnsetType = UNSET

    @property
    def place(self) -> Vector | UnsetType:
        """The place by whichever name."""
        return self.values if self.position is UNSET else self.position


class Commands(Struct):
    """Commands to an Inverse3, valid until the next message."""

    set_cursor_force: ForceCommand | UnsetType = UNSET
    set_cursor_position: PositionCommand | UnsetType = UNSET
    probe_position: dict[str, msgspec.Raw] | UnsetType = UNSET


class _PresetChoice(Struct):
    preset: str = "defaults"


class _Configure(Struct):
    preset: str | _PresetChoice | UnsetType = UNSET


class DeviceCommand(Struct):
    """A command to one Inverse3."""

    device_id: str
    configure: _Configure | UnsetType = UNSET
    commands: Commands | UnsetType = UNSET

    @property
    def preset(self) -> str | None:
        """The preset of the workspace that is requested, if any."""
        if self.configure is UNSET or self.configure.preset is UNSET:
            return None
        chosen = self.configure.preset
        return chosen if isinstance(chosen, str) else chosen.preset


class _Profile(Struct):
    name: str


class _SessionConfigure(Struct):
    profile: _Profile | UnsetType = UNSET


class SessionCommand(Struct):
    """A command to the session: its profile, once, or a state with configs."""

    configure: _SessionConfigure | UnsetType = UNSET
    force_render_full_state: dict[str, msgspec.Raw] | UnsetType = UNSET


class ClientMessage(Struct):
    """A client's message; other keys are ignored, as the service does."""

    session: SessionCommand | UnsetType = UNSET
    inverse3: list[DeviceCommand] | UnsetType = UNSET

    @classmethod
    def of_force(
        cls, device_id: str, force: Vector, version: Version, *, profile: str | None = None
    ) -> "ClientMessage":
        """Return the message that gives one Inverse3 a force."""
        command = ForceCommand(values=force) if version == "3.1" else ForceCommand(vector=force)
        session = UNSET
        if profile is not None:
            session = SessionCommand(configure=_SessionConfigure(profile=_Profile(profile)))
        return cls(session, [DeviceCommand(device_id, commands=Commands(command))])


_service = msgspec.json.Decoder(ServiceMessage)
_client = msgspec.json.Decoder(ClientMessage)


def read_service_message(content: bytes | str) -> ServiceMessage:
    """Return an inventory or a state."""
    try:
        message = _service.decode(content)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProtocolError(f"not a message of Haply's service: {error}") from error
    for device in message.inverse3:
        state = device.state
        if state is not UNSET and not (
            state.cursor_position.finite and state.cursor_velocity.finite
        ):
            raise ProtocolError(f"the cursor of {device.device_id} is at no place")
    return message


def read_client_message(content: bytes | str) -> ClientMessage:
    """Return a client's message, decoded."""
    try:
        message = _client.decode(content)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProtocolError(f"not a message to Haply's service: {error}") from error
    for each in message.inverse3 or ():
        commands = each.commands
        if commands is UNSET:
            continue
        if commands.set_cursor_force is not UNSET:
            _check(commands.set_cursor_force.force, each.device_id, "force")
        if commands.set_cursor_position is not UNSET:
            _check(commands.set_cursor_position.place, each.device_id, "place")
    return message


def _check(wanted: Vector | UnsetType, device_id: str, what: str) -> None:
    if wanted is not UNSET and not wanted.finite:
        raise ProtocolError(f"the {what} for {device_id} is no number")
