"""What tests of several packages share."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

import kernel_cache  # noqa: F401  (before any numba, which reads then what this sets)

# Scripts of `make soak` and `make screenshots`; one needs a fuzzer that only the former installs.
SCRIPTS = ("soak", "kill_fuzz", "file_fuzz", "screenshots", "film")
collect_ignore = [f"app/{name}.py" for name in SCRIPTS]
COMPILE = ("bed", "closed_forms", "many", "exact", "two_grasps")
"""Tests of physics that compile the kernels on which all others wait."""
QUICK = ("physics", "organ_geometry", "assets")
"""Folders of the quick lane, `-m quick`; to it belong tests of `app` that need sessions only."""
SLOW = {
    "test_a_bar_twice_as_thick_is_sixteen_times_as_stiff",
    "test_a_beam_over_a_round_post",
    "test_a_bent_organ_that_crosses_its_sections_twice_is_warned_of",
    "test_a_bent_tube_is_bent_by_its_axis_alone",
    "test_a_branch_is_a_tube_of_its_own",
    "test_a_careful_hand_passes_every_exercise_and_the_others_none",
    "test_a_dark_organ_is_found_and_deep_levels_stay",
    "test_a_duct_pulled_off_its_bed_while_all_relaxes_keeps_its_energy_balance",
    "test_a_finer_tolerance_takes_more_bytes",
    "test_a_folder_written_anew_has_the_committed_names",
    "test_a_fork_s_joins_angles_and_radii_converge",
    "test_a_grey_aorta_is_found_where_its_masks_are_or_given_up",
    "test_a_joined_tube_s_surface_reaches_into_the_one_that_it_joins",
    "test_a_jumping_organ_is_warned_of",
    "test_a_lumen_outside_is_refused_by_its_section",
    "test_a_network_is_solved_as_the_full_matrix",
    "test_a_pull_in_space_tears_every_duct_before_it_is_stretched_as_far_as_a_straight_one",
    "test_a_pull_in_the_plane_tears_every_duct_too",
    "test_a_reader_made_from_the_document_alone_gives_the_same_organ",
    "test_a_real_duct_lies_on_the_mesh_it_was_cut_from",
    "test_a_rod_pressed_on_a_rigid_duct",
    "test_a_section_that_the_sample_misses_is_kept_too",
    "test_a_slack_second_hook_is_none",
    "test_a_tolerance_below_the_floor_names_the_smallest",
    "test_a_tolerance_out_of_reach_names_the_smallest_of_a_long_stack_too",
    "test_a_wall_breaks_in_space_as_in_the_plane_and_in_the_library",
    "test_all_sections_together_are_kept_to_what_they_may_in_a_long_stack",
    "test_all_sections_together_fill_what_they_may_be_off",
    "test_an_oblique_volume_s_tubes_stand_where_its_axes_say",
    "test_an_organ_of_a_size_that_none_has_is_refused",
    "test_another_duct_has_exercises_of_its_own",
    "test_break_event_is_the_root_of_the_criterion",
    "test_calibrated_threshold_breaks_at_its_force",
    "test_committed_images_are_those_the_generator_draws",
    "test_each_bears_what_it_bears_alone",
    "test_every_flipped_bit_is_refused",
    "test_every_seed_builds_what_was_drawn",
    "test_every_truncation_is_refused",
    "test_good_hands_pass_and_others_are_told_why_they_fail",
    "test_gradient_and_tangent_are_the_energy_s_differences",
    "test_grey_images_are_looked_at_with_a_threshold_only",
    "test_hundreds_of_equal_discs_are_a_straight_organ",
    "test_images_out_of_order_are_doubtful",
    "test_images_that_are_missing_by_their_names_are_said",
    "test_integrators_hold_below_their_limit_and_run_away_above",
    "test_it_is_scipy_s_spline_of_the_parabolas_slopes",
    "test_kanninen_s_double_cantilever",
    "test_kernels_are_their_python_form",
    "test_key_sections_move_to_where_they_keep_the_organ",
    "test_lengthwise_slices_are_cut_again_and_it_is_said",
    "test_lobes_are_found_to_a_twentieth_of_a_pixel",
    "test_masks_and_grey_images_give_the_same_organ",
    "test_no_bytes_do_more_than_be_refused",
    "test_no_pull_is_lost",
    "test_no_pull_is_lost_in_real_time",
    "test_no_rod_passes_the_duct_at_any_speed",
    "test_nothing_touches_at_rest",
    "test_page_solve_and_export_agree_to_the_digit",
    "test_pages_and_files_give_the_same_organ",
    "test_reading_an_organ_loads_no_image_library",
    "test_real_anisotropic_pixels",
    "test_real_ducts_stay_below_the_published_fit",
    "test_rods_among_strands_lose_no_pull",
    "test_samples_take_few_bytes_more_than_a_search_by_all_sections",
    "test_says_of_a_force_that_it_is_rounding",
    "test_sections_unlike_their_neighbours_are_kept_or_refused",
    "test_skins_of_organs_and_pieces_are_embedded",
    "test_the_duodenum_s_sections_lie_on_its_reference",
    "test_the_file_gives_back_what_was_written",
    "test_the_frog_s_label_is_its_masks_along_x",
    "test_the_lumen_is_inside",
    "test_the_minimal_path_keeps_to_the_middle",
    "test_the_promise_holds_on_tubes",
    "test_the_tangent_is_the_energy_s_second_derivative",
    "test_the_thesis_s_rule_keeps_the_promise_with_more_sections",
    "test_the_trachea_shows_its_lumen_where_it_is_a_closed_ring",
    "test_tubes_that_only_touch_are_not_joined",
    "test_tubes_that_press_each_other_are_in_balance_and_mirror_each_other",
    "test_two_arms_peel_apart_at_a_t",
    "test_two_thousand_random_cold_solves",
    "test_voxels_are_put_together_where_they_are_many",
    "test_what_is_written_is_read_to_the_bit",
    "test_whatever_is_done_figures_stay_numbers_and_a_duct_tears_once",
    "test_who_does_what_next_asks_for_passes",
}
"""Those of them that take over 1 s of a processor; `-m quick --durations=20` finds others."""

# A machine may be busy.
settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")

# A shell's background job ignores interrupts, and what it starts would too.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the quick lane, and let one process compile the bed and the other the exact beam."""
    for item in items:
        if _is_quick(item):
            item.add_marker("quick")
    first = {f"test_{name}.py": rank for rank, name in enumerate(COMPILE)}
    items.sort(key=lambda item: first.get(item.path.name, len(first)))


def _is_quick(item: pytest.Item) -> bool:
    """Whether a test needs neither a page nor another process, and little time."""
    folder = item.path.relative_to(item.config.rootpath).parts[:-1]
    if getattr(item, "originalname", "") in SLOW or item.get_closest_marker("long"):
        return False
    return any(each in QUICK for each in folder[:2]) or (
        folder == ("tests", "app") and _needs_sessions_only(item)
    )


def _needs_sessions_only(item: pytest.Item) -> bool:
    """Whether a test's file imports of `app` only what simulates, and commands to it."""
    imported = {
        str(getattr(each, "__module__", None) or getattr(each, "__name__", ""))
        for each in vars(getattr(item, "module", item)).values()
    }
    of_app = {".".join(name.split(".")[:2]) for name in imported if name.startswith("app.")}
    return {"app.simulation"} <= of_app <= {
        "app.simulation",
        "app.command_line",
    } and not imported & {"browser", "subprocess"}


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real sections, which is not part of the repository."""
    named = os.environ.get("BLUNTDISSECT_DATA")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real sections are not here: no folder {folder}; set BLUNTDISSECT_DATA")
    return folder


@pytest.fixture(scope="session", autouse=True)
def _browser_ends() -> Iterator[None]:
    """The browser is shared by all tests that need one."""
    yield
    if (shared := sys.modules.get("browser")) is not None:
        shared.close_browser()
