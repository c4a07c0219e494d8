"""Tests that `make test-long` runs every night, and the cheaper ones that find the same in `make test`.

A key is a file, a test (`file::name`) or one of its cases (`file::name[id]`), a value is the cheaper test. A test of a
live graph has the mark `long` in its own file, next to the case that stays.
"""

SERVED = "runner/executors/test_served_workers.py"
HOSTILE = "cli/test_hostile_archive.py"
ELSEWHERE = f"{HOSTILE}::test_an_episode_that_claims_to_lie_elsewhere_is_neither_read_nor_written"
CONFINED = "its case [episodes/link]; results/files/test_confined_paths.py"

LONG = {
    # Killed processes and clusters: the loop, the claims and the restart are tested in one process.
    f"{SERVED}::test_any_number_of_workers_gives_the_same_results": (
        "runner/executors/test_local_pool.py::test_two_workers_give_the_same_bits_as_one"
    ),
    f"{SERVED}::test_a_killed_worker_costs_its_episode_only": (
        "runner/executors/test_pool.py::test_a_trial_of_a_lost_worker_runs_again_after_the_others"
    ),
    f"{SERVED}::test_a_killed_server_that_returns_costs_the_episodes_of_that_moment_only": (
        "models/remote/test_policy.py, runner/executors/test_pool.py"
    ),
    "runner/executors/test_local_pool.py::test_trials_of_a_killed_fork_server_run_again": (
        "runner/executors/test_process.py::test_workers_of_an_ended_fork_server_are_reported_as_killed"
    ),
    "runner/executors/test_local_pool.py::test_two_lost_fork_servers_are_replaced": (
        "runner/executors/test_pool.py::test_the_loop_waits_for_workers_that_replace_lost_ones"
    ),
    "runner/executors/test_local_pool.py::test_ctrl_c_at_the_driver_ends_every_episode_recorded": (
        "runner/executors/test_pool.py::test_a_stop_request_reaches_the_workers"
    ),
    "runner/executors/test_ray_pool.py::test_a_campaign_on_a_cluster_that_requires_a_token": (
        "runner/executors/test_collecting.py"
    ),
    "runner/executors/test_ray_pool.py::test_each_connection_problem_has_its_own_line": (
        "runner/executors/test_ray_pool.py::test_every_connection_error_is_one_line"
    ),
    "cli/study/test_verbs.py::test_a_killed_study_keeps_its_schedule_and_has_the_outcomes_of_plain_runs": (
        "results/writing/test_recovery.py, runner/study/test_integrity.py"
    ),
    "cli/running/test_run.py::test_processes_that_a_model_leaves_behind_end_with_the_run[2]": "its case [1]",
    "cli/running/test_run.py::test_a_stopped_run_says_how_to_go_on[15-143-interrupted]": (
        "its other case; runner/stopping/test_requests.py"
    ),
    "cli/running/test_run.py::test_the_live_viewer_stays_until_ctrl_c_where_a_person_sits_at_a_terminal": (
        "cli/results/test_view.py::test_the_viewer_ends_when_the_command_is_killed"
    ),
    "cli/running/test_run_with_a_person.py::test_a_second_sigterm_ends_a_model_that_never_comes_back_from_reset": (
        "runner/stopping/test_requests.py::test_a_second_signal_halts_the_robot_and_ends_the_process"
    ),
    "cli/running/test_run_with_a_person.py::test_the_space_bar_ends_the_episode_and_the_session_goes_on": (
        "runner/stopping/test_emergency_key.py"
    ),
    "cli/running/test_run_with_a_person.py::test_a_models_own_threads_do_not_outlive_the_run": (
        "cli/running/test_run.py::test_processes_that_a_model_leaves_behind_end_with_the_run"
    ),
    "cli/running/test_run_with_a_person.py::test_ctrl_c_at_a_question_leaves_the_episode_awaiting_judgement": (
        "cli/running/test_run_with_a_person.py::test_a_hang_up_at_a_question_loses_nothing"
    ),
    "runner/stopping/test_requests.py::test_a_second_signal_halts_the_robot_and_ends_the_process[15]": "its other case",
    "interop/test_killed_merge.py": "interop/test_merge.py, results/writing/test_recovery.py",
    f"{SERVED}::test_more_workers_than_sessions_are_refused_in_one_line[batch1]": (
        "its other case; models/remote/test_sessions.py"
    ),
    "runner/executors/test_local_pool.py::test_a_late_setup_of_an_earlier_campaign_is_not_used": (
        "runner/executors/test_collecting.py::test_a_worker_with_another_setup_is_refused"
    ),
    f"{ELSEWHERE}[../elsewhere]": CONFINED,
    f"{ELSEWHERE}[/tmp/../{{0}}/elsewhere]": CONFINED,
    **{
        f"{HOSTILE}::test_nothing_is_imported_from_the_archive_in_which_one_stands[words{number}]": "its case [words0]"
        for number in (1, 2, 3)
    },
    # Whole stories in a browser: the same pages answer without one.
    "web/test_blind_study_by_clicks.py": "cli/study/test_verbs.py, runner/study/test_output_redaction.py",
    "web/second_judgement/test_second_judgement_in_browser.py": "web/second_judgement/test_second_judgement_app.py",
    "web/site_editor/test_goals.py::test_goals_of_every_kind_are_drawn": (
        "web/site_editor/test_goals.py::test_goals_are_edited_with_keys_undone_and_checked_where_they_stand"
    ),
    "web/site_editor/test_editor.py::test_a_tablet_scales_an_image_draws_by_touch_and_pinches": (
        "web/site_editor/test_editor.py::test_a_flat_is_drawn_from_a_map_with_mouse_and_keyboard"
    ),
    "cli/results/test_view.py::test_the_web_viewer_shows_every_panel_and_contacts_no_other_host": (
        "viewer/test_recording.py, viewer/test_rebuild.py"
    ),
    "report/test_figure_layout.py::test_nothing_is_cut_off_and_no_words_lie_over_others[1]": "its case [10]",
    "report/test_figure_layout.py::test_nothing_is_cut_off_and_no_words_lie_over_others[2]": "its case [10]",
    "report/test_figures.py::test_figures_drawn_in_two_processes_are_the_same_and_complete": (
        "report/test_figures.py::test_the_same_record_gives_the_same_bytes"
    ),
    "evidence/bundle/test_make.py::test_the_same_record_gives_the_same_bytes_in_every_process": (
        "test_releases.py::test_a_record_and_a_bundle_are_verified"
    ),
    "web/results_browser/test_disturbances.py::test_a_trial_with_and_without_a_disturbance_open_side_by_side": (
        "web/results_browser/test_page_in_browser.py::test_a_disagreement_is_found_opened_scrubbed_and_tagged_by_keyboard"
    ),
    "test_docs.py::test_the_website_has_a_search_when_it_is_opened_as_files": (
        "test_docs.py::test_the_website_has_every_page_and_asks_no_other_host"
    ),
    # Installations, which .github/workflows/wheels.yml tries in clean environments as well.
    "test_installation.py::test_the_advice_of_a_wheel_installs_the_extra_from_another_directory": (
        "cli/test_missing_extras.py"
    ),
    "test_installation.py::test_a_target_installs_its_own_tools_only": "test_workflows.py",
    # Repetitions with other seeds, sizes and noise.
    "models/vlv/test_map_against_site.py::test_they_nearly_do_with_noisy_depth_after_the_temporal_median": (
        "models/vlv/test_map_against_site.py::test_free_and_occupied_cells_agree_with_the_site"
    ),
    "results/writing/test_recovery.py::test_three_killed_drivers_on_an_empty_record_run_every_trial_once[postgresql]": (
        "its case [sqlite]"
    ),
    "results/merging/test_studies.py::test_a_study_that_two_places_shared_becomes_one_again[postgresql]": (
        "its case [sqlite]"
    ),
    "cli/running/test_stress.py::test_two_workers_give_the_same_numbers": (
        "runner/executors/test_local_pool.py::test_two_workers_give_the_same_bits_as_one"
    ),
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[UniNaVid]": (
        "its case [NavDP]"
    ),
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[NaVILA]": "its case [NavDP]",
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[VLFMHabitat]": (
        "its case [VLFMReality]"
    ),
    "statistics/test_agreement.py::test_the_interval_of_a_rank_correlation_covers_single_items": (
        "statistics/test_agreement.py::test_the_interval_of_a_rank_correlation_covers_whole_starting_positions"
    ),
    "web/results_browser/test_page_in_browser.py::test_a_script_in_any_text_of_a_record_does_not_run": (
        "web/results_browser/test_page_in_browser.py::test_names_from_a_record_are_text"
    ),
    **{
        f"models/remote/test_websockets_versions.py::{test}[{major}]": "its cases of the oldest and the newest version"
        for major in (12, 13, 14, 15, 16)
        for test in ("test_a_model_in_another_environment_answers",)
    },
}
