"""Tests that `make test-long` runs every night, and the cheaper ones that find the same in `make test`.

A key is a file, a test (`file::name`) or one of its cases (`file::name[id]`), a value is the cheaper test. Cases of a
live graph of ROS 2 and of two-dimensional tables have the mark `long` in their own file, next to the cases that stay.
"""


def _of(file: str, cheaper: str, *tests: str) -> dict[str, str]:
    """Return tests of a file that have one cheaper test, in the form of `LONG`."""
    return {f"{file}::{test}": cheaper for test in tests}


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
    "cli/running/test_run.py::test_processes_that_a_model_leaves_behind_end_with_the_run[2]": (
        "runner/stopping/test_requests.py"
    ),
    "cli/running/test_run.py::test_a_stopped_run_says_how_to_go_on[15-143-interrupted]": (
        "its other case; runner/stopping/test_requests.py"
    ),
    "cli/running/test_run.py::test_the_live_viewer_stays_until_ctrl_c_where_a_person_sits_at_a_terminal": (
        "viewer/test_recording.py"
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
        "results/writing/test_recovery.py, runner/stopping/test_requests.py"
    ),
    "runner/stopping/test_requests.py::test_a_second_signal_halts_the_robot_and_ends_the_process[15]": "its other case",
    "interop/test_killed_merge.py": "interop/test_merge.py, results/writing/test_recovery.py",
    f"{SERVED}::test_more_workers_than_sessions_are_refused_in_one_line[batch1]": ("models/remote/test_sessions.py"),
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
    "web/site_editor/test_goals.py::test_a_way_is_drawn_with_keys_on_a_narrow_screen": (
        "web/site_editor/test_goals.py::test_points_are_placed_sequences_ordered_and_routes_photographed_along_a_way"
    ),
    "web/site_editor/test_editor.py::test_a_tablet_scales_an_image_draws_by_touch_and_pinches": (
        "web/site_editor/test_editor.py::test_a_wall_is_drawn_moved_undone_and_saved_by_keyboard"
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
    # Invalid inputs of the loaders that take half a second each.
    **_of(
        "fuzz/test_fuzz.py",
        "cli/test_hostile_archive.py, evidence/verification/test_hostile_records.py",
        "test_nothing_gets_past_a_loader_s_boundary[bundle]",
        "test_nothing_gets_past_a_loader_s_boundary[record]",
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
        "results/writing/test_recovery.py::test_an_episode_of_a_killed_process_keeps_its_steps_and_its_trial_runs_again"
    ),
    "results/merging/test_studies.py::test_a_study_that_two_places_shared_becomes_one_again[postgresql]": (
        "its case [sqlite]"
    ),
    "cli/running/test_stress.py::test_two_workers_give_the_same_numbers": (
        "runner/executors/test_local_pool.py::test_two_workers_give_the_same_bits_as_one"
    ),
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[UniNaVid]": (
        "its test of NavDP"
    ),
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[NaVILA]": (
        "its test of NavDP"
    ),
    "examples/test_adapters.py::test_the_adapters_pass_models_check_and_state_their_camera[VLFMHabitat]": (
        "its test of NavDP"
    ),
    "statistics/test_agreement.py::test_the_interval_of_a_rank_correlation_covers_single_items": (
        "statistics/test_conclusion.py"
    ),
    "web/results_browser/test_page_in_browser.py::test_a_script_in_any_text_of_a_record_does_not_run": (
        "web/results_browser/test_page_in_browser.py::test_names_from_a_record_are_text"
    ),
    # The commands of a page, one after the other: their names, options and JSON are tested every day.
    **_of(
        "docs/test_commands.py",
        "its case [robots.md]; docs/test_json_schemas.py, README's",
        *(
            f"test_the_commands_of_a_page_succeed_in_order[{page}.md]"
            for page in (
                "bundle",
                "export",
                "look",
                "models",
                "pirlnav",
                "report",
                "results",
                "scale",
                "stress",
                "study",
            )
        ),
        "test_the_commands_of_a_page_succeed_in_order[vlv.md]",
        "test_the_rehearsal_of_a_robot_on_ros_1_runs_in_its_terminals",
    ),
    **_of(
        "docs/test_json_schemas.py",
        "docs/test_json_schemas.py: frozen outputs and quick commands; golden/test_golden.py",
        "test_the_output_of_a_command_is_as_its_schema_says",
        "test_every_part_of_a_schema_is_compared_with_a_value",
        "test_times_are_in_iso_8601",
        "test_the_page_of_a_second_rater_is_as_its_schema_says",
    ),
    # Pages in a browser: each keeps one walk through it.
    **_of(
        "web/site_editor/test_goals.py",
        "web/site_editor/test_goals.py::test_goals_are_edited_with_keys_undone_and_checked_where_they_stand",
        "test_goals_that_break_the_format_are_shown_with_their_faults",
        "test_a_fault_of_a_goal_is_a_finding_at_its_entry",
        "test_the_page_with_goals_is_accessible_on_a_phone_and_a_desk",
        "test_a_renamed_object_remains_a_target",
    ),
    **_of(
        "web/site_editor/test_editor.py",
        "web/site_editor/test_editor.py::test_a_wall_is_drawn_moved_undone_and_saved_by_keyboard",
        "test_a_flat_is_drawn_from_a_map_with_mouse_and_keyboard",
        "test_findings_are_those_of_sites_check",
        "test_a_door_and_its_ends_snap_to_the_grid_along_their_wall",
        "test_a_room_corner_can_be_dragged_a_short_distance",
        "test_alt_suspends_snapping",
        "test_corners_snap_to_straight_lines_walls_and_the_grid",
    ),
    **_of(
        "web/operator/test_page_in_browser.py",
        "web/operator/test_page_in_browser.py::test_an_episode_is_judged_undone_and_declared_void_by_keyboard",
        "test_a_saved_judgement_can_be_undone_at_the_bottom_of_the_next_screen",
        "test_a_redraw_keeps_the_focus_and_an_open_form",
        "test_a_slow_answer_does_not_redraw_the_form_and_undo_keeps_the_choices",
        "test_the_page_shows_the_time_and_the_path_that_are_left",
        "test_state_changes_request_no_additional_live_pictures",
        "test_the_judging_form_shows_the_goal_and_the_last_frames",
    ),
    **_of(
        "web/results_browser/test_page_in_browser.py",
        "web/results_browser/test_page_in_browser.py::test_a_disagreement_is_found_opened_scrubbed_and_tagged_by_keyboard",
        "test_every_view_is_accessible_and_fits_the_screen",
        "test_the_grid_fills_while_a_run_goes_on",
        "test_the_address_with_the_token_opens_the_episode_that_it_names",
    ),
    **_of(
        "web/results_browser/test_website.py",
        "web/results_browser/test_website.py::test_episodes_are_looked_at_without_a_server_of_ours",
        "test_a_selection_limits_the_site_and_replaces_the_one_before",
        "test_images_are_made_smaller_and_a_directory_of_others_is_not_touched",
    ),
    **_of(
        "report/test_page.py",
        "report/test_page.py::test_the_page_works_without_a_network_and_sorts_by_a_click",
        "test_the_page_is_led_by_its_question_and_folds_what_is_long[1280]",
        "test_everybody_can_read_the_page_and_sort_it_by_keyboard",
    ),
    # Trainings, killed and whole.
    **_of(
        "training/test_run.py",
        "training/test_rollout.py, training/test_expert.py",
        "test_a_run_ends_in_a_checkpoint_that_the_models_own_reader_takes",
        "test_a_failed_write_loses_only_its_own_step",
        "test_a_killed_run_goes_on_and_ends_in_the_same_weights",
        "test_the_workers_of_a_killed_run_end_too",
    ),
    **_of(
        "training/test_expert.py",
        "training/test_rollout.py",
        "test_following_it_reaches_the_goal_in_about_as_few_actions_as_the_planner[toilet]",
        "test_following_it_reaches_the_goal_in_about_as_few_actions_as_the_planner[bed]",
    ),
    # Whole stories from the command line: each of their steps has a test in one process.
    **_of(
        "cli/study/test_verbs.py",
        "runner/study/test_output_redaction.py, results/reading/test_queries.py",
        "test_a_blind_study_from_new_to_report_names_no_model_anywhere_an_operator_looks",
    ),
    **_of(
        "report/comparison/test_compare.py",
        "report/comparison/test_compare.py::test_several_questions_are_corrected_together",
        "test_a_study_and_compare_give_the_same_answers_on_one_record",
        "test_which_seed_ran_first_changes_nothing_and_no_seed_drops_out",
    ),
    **_of(
        "cli/running/test_run.py",
        "results/writing/test_recovery.py, runner/stopping/test_requests.py",
        "test_a_killed_run_loses_no_committed_step_and_the_same_command_finishes_it",
        "test_processes_that_a_model_leaves_behind_end_with_the_run[1]",
        "test_a_stopped_run_says_how_to_go_on[2-130-aborted]",
    ),
    **_of(
        "runner/executors/test_local_pool.py",
        "results/writing/test_recovery.py, runner/executors/test_pool.py",
        "test_killed_workers_and_drivers_lose_no_trial_and_leave_no_files",
    ),
    **_of(
        "cli/evidence/test_verify.py",
        "evidence/bundle/test_make.py",
        "test_an_intact_bundle_ends_with_0_and_names_the_signer",
    ),
    **_of(
        "evidence/verification/test_against.py",
        "evidence/verification/test_against.py::test_a_bundle_is_compared_and_trials_of_one_record_only_are_counted",
        "test_records_of_the_same_trials_are_equal_and_the_command_says_so",
    ),
    **_of(
        "evidence/verification/test_derived.py",
        "test_releases.py::test_a_record_and_a_bundle_are_verified",
        "test_an_intact_bundle_is_compared_completely",
    ),
    **_of(
        "evidence/verification/test_verify.py",
        "evidence/verification/test_verify.py::test_an_intact_record_holds_and_episodes_driven_again_are_identical",
        "test_a_delay_of_the_model_counts_towards_the_limit_of_time",
    ),
    **_of(
        "evidence/bundle/test_make.py",
        "evidence/bundle/test_make.py::test_a_bundle_has_every_episode_as_it_was",
        "test_weights_are_added_only_when_asked_for",
        "test_a_record_on_a_server_is_bundled_as_an_sqlite_file",
    ),
    **_of(
        "cli/test_init.py",
        "models/test_contract_check.py",
        "test_a_run_that_watches_runs_again_when_the_model_changes",
        "test_a_package_begun_with_models_new_passes_its_own_tests",
    ),
    **_of(
        "cli/running/test_run_with_a_person.py",
        "runner/judging/test_faces.py",
        "test_a_hang_up_at_a_question_loses_nothing",
    ),
    **_of(
        "cli/running/test_stress.py",
        "report/comparison/test_stress.py",
        "test_the_undisturbed_condition_is_a_plain_run_bit_for_bit",
    ),
    **_of(
        "cli/test_sweep.py",
        "runner/setup/test_sweep.py",
        "test_the_workers_of_a_sweep_stay_from_campaign_to_campaign",
    ),
    **_of(
        "cli/support/test_output.py",
        "its cases of `run`",
        "test_prints_of_a_model_do_not_spoil_the_json[stress --goal chair --starts 1 --disturb latency --severity 1 "
        "--results s]",
        "test_prints_of_a_model_do_not_spoil_the_json[run --goal chair --starts 1 --seed 0-1]",
    ),
    **_of(
        "cli/results/test_browse.py",
        "its case [15]",
        "test_a_signal_ends_the_page_and_removes_its_videos[1]",
        "test_a_signal_ends_the_page_and_removes_its_videos[2]",
    ),
    **_of(
        "cli/results/test_read_only.py",
        "results/schema/test_engine.py",
        "test_a_read_only_record_is_read_whole_and_stays_as_it_is[False]",
    ),
    **_of(
        "cli/results/test_view.py",
        "viewer/test_recording.py",
        "test_the_viewer_ends_when_the_command_is_killed",
    ),
    **_of(
        "cli/test_record_verbs.py",
        "results/reading/test_queries.py",
        "test_a_campaign_is_chosen_by_its_number_or_by_eight_digits_of_its_key",
    ),
    **_of(
        "cli/test_sites.py",
        "simulator/generated_sites/test_generate.py",
        "test_a_generated_flat_is_shown_checked_and_drawn_by_its_seed",
    ),
    **_of(
        "text/test_log_output.py",
        "runner/executors/test_process.py",
        "test_worker_processes_log_to_the_same_file",
    ),
    **_of(
        "results/writing/test_recovery.py",
        "results/writing/test_recovery.py::test_an_episode_of_a_killed_process_keeps_its_steps_and_its_trial_runs_again",
        "test_three_killed_drivers_on_an_empty_record_run_every_trial_once[sqlite]",
    ),
    **_of(
        "runner/setup/test_sweep.py",
        "runner/setup/test_sweep.py::test_several_generated_sites_may_lack_a_goal_that_some_have",
        "test_a_sweep_skips_what_a_generated_site_lacks_and_runs_the_rest",
    ),
    # Adapters and examples in servers of their own: the wire's checks run every day.
    **_of(
        "examples/test_adapters.py",
        "its test of NavDP; models/remote/test_policy.py",
        "test_the_adapters_pass_models_check_and_state_their_camera[VLFMReality]",
        "test_vlfms_habitat_policy_drives_discrete_actions",
        "test_navila_drives_as_far_as_its_answers_say[True]",
        "test_uninavid_executes_predicted_actions[True]",
        "test_vlfms_displacements_without_a_sub_goal_are_upstreams",
    ),
    **_of(
        "examples/test_point_robot.py",
        "examples/test_examples.py",
        "test_the_example_runs_resumes_and_is_another_robot_after_an_edit",
    ),
    **_of(
        "models/remote/test_websockets_versions.py",
        "its test of an answer, case [11]",
        "test_the_command_runs_a_model_in_another_environment[11]",
    ),
    **_of(
        "models/pirlnav/test_checkpoint.py",
        "models/pirlnav/test_parity.py",
        "test_a_full_size_checkpoint_runs_on_camera_images",
    ),
    # Repetitions of physics, geometry and statistics with other numbers.
    **_of(
        "localization/test_matching.py",
        "localization/test_matching.py::test_a_robot_at_another_mark_is_not_in_place",
        "test_a_turn_finds_how_far_ahead_the_camera_sits",
        "test_an_offset_is_measured_in_a_room_that_is_not_quite_as_surveyed",
        "test_headings_that_the_odometry_wraps_are_those_of_one_turn",
    ),
    **_of(
        "robots/test_simulated.py",
        "sensing/test_mover.py, sensing/test_difficult_bases.py",
        "test_of_many_actions_every_move_is_within_5_mm[lola2 for long-believed]",
    ),
    **_of(
        "report/test_figure_layout.py",
        "report/test_figure_layout.py::test_success_and_failure_end_at_their_shares_of_all_episodes",
        "test_nothing_is_cut_off_and_no_words_lie_over_others",
    ),
    **_of(
        "simulator/generated_sites/test_generate.py",
        "its case [2]",
        "test_the_oracle_reaches_every_goal[1001]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[10000]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[10003]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[10004]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[1003]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[1002]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[10002]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[1004]",
    ),
    **_of(
        "statistics/test_agreement.py",
        "statistics/test_conclusion.py",
        "test_the_interval_of_a_rank_correlation_covers_whole_starting_positions",
    ),
    **_of(
        "study/test_stopping.py",
        "statistics/sequential/test_betting.py",
        "test_three_equal_arms_are_rarely_told_apart_looking_after_every_block",
    ),
    **_of(
        "models/baselines/test_oracle.py",
        "models/baselines/test_oracle.py::test_a_goal_with_no_way_to_it_is_given_up_at_once",
        "test_it_corrects_for_a_robot_that_moves_inexactly",
    ),
    # Live graphs of ROS 1: the same link, node and faults of ROS 2, of one process, and the cases that stay.
    **_of(
        "robots/test_ros1_run.py",
        "ros/ros2/test_stack.py; golden/test_golden.py",
        "test_the_stack_in_three_processes_acts_as_the_simulation[lola2]",
        "test_an_unattended_run_records_estimated_distances",
    ),
    **_of(
        "robots/test_ros1_blind_camera.py",
        "robots/test_blind_camera.py",
        "test_a_faulty_camera_ends_the_episode_with_its_reason",
    ),
    **_of(
        "robots/test_ros1_rehearsal.py",
        "robots/test_rehearsal.py",
        "test_a_rehearsal_over_ros_1_is_placed_and_judged_on_the_page",
    ),
    **_of(
        "robots/test_calibration.py",
        "ros/ros2/test_calibration.py",
        "test_a_failed_measurement_over_ros1_is_an_error_of_one_line",
    ),
    **_of(
        "ros/ros1/test_discrete_move.py",
        "sensing/test_difficult_bases.py",
        "test_a_base_with_noise_at_rest_moves_accurately",
    ),
    **_of(
        "robots/test_ros1_tf.py",
        "sensing/odometry/test_transform_chain.py",
        "test_doctor_sees_the_odometry_of_frames_follow_a_turn",
        "test_frames_that_do_not_connect_are_named_by_doctor_and_by_a_session",
    ),
    **_of(
        "robots/test_ros1_network.py",
        "ros/ros2/test_faults.py",
        "test_a_robot_that_is_carried_repeatedly_never_loses_its_first_action",
        "test_a_part_that_returns_while_an_episode_begins_is_waited_for",
    ),
    **_of(
        "cli/robots/test_doctor.py",
        "its case of the silent camera; robots/test_calibration.py",
        "test_a_server_that_steers_another_topic_is_not_ready",
        "test_a_broken_part_is_named_with_what_to_do[camera-blind-/camera/depth/image_raw-failed-silent for]",
    ),
    **{
        f"models/remote/test_websockets_versions.py::{test}[{major}]": "its cases of the oldest and the newest version"
        for major in (12, 13, 14, 15, 16)
        for test in ("test_a_model_in_another_environment_answers",)
    },
    # Each takes 4 s of processor time or more, or starts processes, and repeats a cheaper test on a larger record, with
    # another engine or in a second form.
    **_of(
        "examples/test_examples.py",
        "its case [widest_opening:WidestOpening]",
        "test_the_examples_pass_models_check[image_goal:HistogramMatcher]",
        "test_the_examples_pass_models_check[frontier:Frontier]",
    ),
    **_of(
        "examples/test_adapters.py",
        "its test of NavDP",
        "test_servers_that_keep_images_forget_them_between_episodes[vint]",
        "test_servers_that_keep_images_forget_them_between_episodes[nomad]",
        "test_a_route_goes_from_photograph_to_photograph",
        "test_planners_that_never_stop_end_near_the_point[viplanner]",
        "test_ddppo_turns_and_drives_discrete_steps_to_a_point",
        "test_dualvln_executes_actions_and_trajectories_and_does_not_look_down",
        "test_the_adapters_pass_models_check_and_state_their_camera[NavDP]",
        "test_vlfms_real_robot_policy_turns_the_base_for_the_arm_and_drives_to_its_sub_goal",
        "test_uninavid_executes_predicted_actions[False]",
        "test_navila_drives_as_far_as_its_answers_say[False]",
    ),
    **_of(
        "cli/study/test_verbs.py",
        "runner/study/test_integrity.py",
        "test_a_record_that_was_changed_is_named_by_every_verb_and_not_run",
    ),
    **_of(
        "report/test_page.py",
        "report/test_page.py::test_the_page_works_without_a_network_and_sorts_by_a_click",
        "test_the_page_is_led_by_its_question_and_folds_what_is_long[390]",
    ),
    **_of(
        "models/vlv/test_mask_rcnn.py",
        "the others of its file, with recorded answers",
        "test_finds_on_a_camera_image_what_torchvision_finds",
    ),
    **_of(
        "docs/test_reference_pages.py",
        "golden/test_golden.py",
        "test_the_page_of_headings_knows_every_heading_of_a_table",
    ),
    **_of("docs/test_served_model.py", "models/remote/test_serving.py", "test_the_server_of_the_page_drives_a_trial"),
    **_of(
        "docs/test_commands.py",
        "its case [robots.md]; cli/test_sites.py, web/operator/test_page.py",
        "test_the_commands_of_a_page_succeed_in_order[sites.md]",
        "test_the_commands_of_a_page_succeed_in_order[console.md]",
    ),
    **_of(
        "benchmarks/test_stops.py",
        "localization/test_matching.py",
        "test_verdicts_by_the_measured_pose_are_right_where_those_by_the_odometry_are_not",
    ),
    **_of(
        "fuzz/test_fuzz.py",
        "errors/test_files.py, `make fuzz`",
        "test_nothing_gets_past_a_loader_s_boundary[site]",
        "test_nothing_gets_past_a_loader_s_boundary[vlv value]",
        "test_nothing_gets_past_a_loader_s_boundary[upstream log]",
        "test_nothing_gets_past_a_loader_s_boundary[mask r-cnn]",
        "test_nothing_gets_past_a_loader_s_boundary[habitat]",
    ),
    **_of(
        "results/test_goals.py",
        "protocol/test_goal_distance.py, results/merging",
        "test_the_oracle_reaches_every_kind_of_goal_and_the_record_keeps_its_definition",
        "test_a_merge_keeps_definitions_and_refuses_different_ones",
    ),
    **_of(
        "cli/running/test_run_keeping.py", "golden/test_golden.py", "test_what_is_kept_changes_nothing_that_happened"
    ),
    **_of(
        "cli/results/test_read_only.py",
        "results/schema/test_engine.py",
        "test_a_read_only_record_is_read_whole_and_stays_as_it_is[True]",
    ),
    **_of(
        "report/comparison/test_compare.py",
        "report/comparison/test_compare.py::test_several_questions_are_corrected_together",
        "test_the_same_outcomes_under_five_seeds_give_the_verdict_of_one",
        "test_several_models_have_a_global_test_and_letters_for_distinct_groups",
    ),
    **_of(
        "cli/test_missing_extras.py",
        "its other cases",
        "test_a_verb_says_which_extra_it_wants[viewer-rerun,rerun_bindings,rerun_cli-view]",
        "test_a_verb_says_which_extra_it_wants[ray-ray-run]",
    ),
    **_of(
        "report/test_figures.py",
        "report/test_figures.py::test_the_same_record_gives_the_same_bytes",
        "test_png_keeps_its_resolution_after_the_vector_forms",
    ),
    **_of(
        "models/remote/test_websockets_versions.py",
        "its test of an answer, case [17]",
        "test_the_command_runs_a_model_in_another_environment[17]",
    ),
    **_of(
        "interop/test_merge.py",
        "interop/test_merge.py::test_a_record_that_was_split_in_five_is_whole_again_with_an_equal_report",
        "test_one_part_after_another_is_the_same_and_twice_is_the_same_as_once",
        "test_pictures_of_a_server_come_from_the_directories_of_its_robots",
    ),
    **_of(
        "interop/test_merge_files.py",
        "its case [truncated]",
        "test_an_intact_copy_repairs_damaged_images[deleted depth]",
        "test_an_intact_copy_repairs_damaged_images[link]",
        "test_an_intact_copy_repairs_damaged_images[empty]",
        "test_an_intact_copy_repairs_damaged_images[deleted colour]",
    ),
    **_of(
        "models/remote/test_serving.py",
        "models/pirlnav/test_parity.py, models/remote/test_policy.py",
        "test_pirlnav_elsewhere_gives_the_same_logits_and_actions_to_the_bit",
    ),
    **_of(
        "results/studies/test_log.py",
        "its cases [sqlite-...]",
        "test_a_merge_unites_two_logs_and_keeps_the_sign_of_a_deleted_event[postgresql-]",
    ),
    **_of(
        "cli/results/test_export_video.py",
        "cli/results/test_export_video.py::test_an_episode_is_a_frame_per_action_and_two_seconds_of_its_verdict",
        "test_a_montage_and_failures_are_chosen_by_options",
        "test_a_hostile_name_and_a_damaged_image_still_become_a_video",
    ),
    **_of(
        "cli/models/test_models.py",
        "models/test_contract_check.py, cli/models/test_models_cards.py",
        'test_a_check_prints_each_result_as_it_is_known_and_json_in_one_piece[option0-"card " in shown]',
        "test_only_what_the_command_line_has_is_shown_as_an_option",
    ),
    **_of(
        "cli/running/test_place.py",
        "runner/episode/test_stop_measurement.py::test_facing_a_bare_wall_the_place_along_it_is_unknown_and_the_odometry_stays",
        "test_an_ambiguous_look_suggests_the_next_command_which_determines_the_pose",
    ),
    **_of(
        "localization/test_matching.py",
        "localization/test_differences.py and the others of its file",
        "test_what_fits_farther_off_than_robots_are_looked_for_is_not_where_it_stands",
        "test_removed_objects_are_reported_and_do_not_bias",
    ),
    **_of(
        "robots/test_blind_camera.py",
        "the others of its file",
        "test_a_camera_without_half_of_its_depth_is_lost_once_the_robot_has_turned",
    ),
    **_of(
        "models/baselines/test_oracle.py",
        "its case [chair]; golden/test_golden.py",
        "test_the_oracle_reaches_every_goal_and_from_every_start_some[toilet]",
        "test_the_oracle_reaches_every_goal_and_from_every_start_some[table]",
    ),
    # Live graphs of ROS 1: ROS 2 runs the same with the same code, and a case of ROS 1 stays.
    **_of(
        "robots/test_ros1_run.py",
        "its case [2-1.0]; ros/ros2/test_stack.py; golden/test_golden.py",
        "test_the_stack_in_three_processes_acts_as_the_simulation[turtlebot2]",
        "test_an_ended_run_leaves_a_robot_at_rest[15-1.0]",
        "test_an_ended_run_leaves_a_robot_at_rest[9-2.0]",
    ),
    **_of(
        "robots/test_ros1.py",
        "robots/test_ros1_drive.py::test_a_server_like_upstreams_executes_discrete_actions_only",
        "test_a_server_like_upstreams_is_compared_with_the_odometry",
    ),
    **_of(
        "robots/test_ros1_stack.py",
        "ros/ros1/test_exchange.py, models/stack/test_topics.py, ros/ros2/test_stack.py",
        "test_two_goals_are_announced_driven_and_judged",
    ),
    "robots/test_ros1_cameras.py": "ros/ros2/test_cameras.py",
    "robots/test_ros1_stack_trials.py": "ros/ros1/test_exchange.py, models/stack, ros/ros2/test_stack.py",
    **_of(
        "robots/test_ros1_camera_faults.py",
        "robots/checkup/test_images.py, robots/checkup/test_checks.py, robots/ros/test_image_timing.py",
        "test_faults_of_a_camera_are_told_apart",
    ),
    **_of(
        "robots/test_ros1_driving_on.py",
        "ros/ros2/test_driving_on.py, whose case of a killed model stays",
        "test_a_lost_model_leaves_a_robot_that_drove_on_at_rest[killed]",
    ),
    **_of(
        "cli/robots/test_doctor_hazards.py",
        "its test of a session; ros/ros2/test_hazard_topics.py, ros/ros2/test_doctor.py",
        "test_doctor_fails_while_a_sensor_is_active[bumper-bumper]",
        "test_doctor_fails_while_a_sensor_is_active[wheel_drop-wheel drop]",
        "test_misspelt_and_wrong_topics_are_said_before_a_session",
    ),
    **_of(
        "robots/test_calibration.py",
        "ros/ros2/test_calibration.py",
        "test_the_doctor_looks_at_the_camera_over_ros1[finds_the_camera_askew]",
        "test_the_doctor_looks_at_the_camera_over_ros1[names_a_contradiction]",
        "test_the_doctor_looks_at_the_camera_over_ros1[crops_the_view_from_a_fisheye_lens]",
    ),
    **_of(
        "robots/test_ros1_network.py",
        "robots/test_ros1.py, ros/ros1/test_service_call.py",
        "test_a_server_that_drives_too_far_is_stopped_after_10_cm",
        "test_a_server_that_steers_another_topic_is_refused_with_both_topics",
    ),
    **_of(
        "cli/robots/test_doctor.py",
        "its other cases",
        "test_a_wedged_server_is_noticed",
        "test_a_broken_part_is_named_with_what_to_do[camera-yuv-colour image-failed-'yuv422']",
        "test_a_broken_part_is_named_with_what_to_do[camera-past-delay-failed-too late for every observation]",
        "test_without_a_real_robot_this_machine_alone_is_checked[words1]",
    ),
    **_of(
        "evidence/verification/test_verify.py",
        "its other cases",
        "test_an_action_that_the_depth_guard_refused_is_driven_again",
    ),
    **_of(
        "cli/test_missing_extras.py",
        "its case [scan-trimesh-sites]",
        "test_a_verb_says_which_extra_it_wants[neural-torch-models]",
        "test_a_verb_says_which_extra_it_wants[video-av-export]",
        "test_a_verb_says_which_extra_it_wants[bags-rosbags-export]",
        "test_a_verb_says_which_extra_it_wants[lerobot-pyarrow-export]",
    ),
    **_of(
        "fuzz/test_fuzz.py",
        "errors/test_files.py, models/pirlnav/test_hostile_checkpoints.py, `make fuzz`",
        "test_nothing_gets_past_a_loader_s_boundary[pirlnav]",
        "test_nothing_gets_past_a_loader_s_boundary[onnx]",
    ),
    **_of(
        "cli/support/test_output.py",
        "its case [run --goal chair --starts 1 --workers 1]",
        "test_prints_of_a_model_do_not_spoil_the_json[models check]",
        "test_prints_of_a_model_do_not_spoil_the_json[doctor]",
    ),
    **_of(
        "interop/test_merge.py",
        "interop/test_merge.py::test_two_records_of_a_condition_become_one_campaign_and_first_results_count",
        "test_a_record_and_its_copy_before_the_upgrade_merge_with_the_same_report",
        "test_verdicts_that_one_side_lacks_are_added_and_move_the_episode_on",
    ),
    **_of(
        "interop/test_merge_files.py",
        "its case [truncated]",
        "test_an_intact_copy_repairs_damaged_images[pipe]",
        "test_damaged_images_are_named_and_nothing_comes_in[empty]",
    ),
    **_of(
        "models/pirlnav/test_checkpoint.py",
        "test_public_api.py; models/pirlnav/test_parity.py",
        "test_a_network_is_built_without_loading_pytorch_s_compiler",
    ),
    **_of(
        "cli/judging/test_second_judge.py",
        "web/second_judgement/test_second_judgement_app.py",
        "test_the_page_is_served_until_ctrl_c",
    ),
    **_of(
        "localization/test_matching.py",
        "its other tests",
        "test_a_coarse_survey_increases_the_uncertainty_of_the_placement",
    ),
    **_of(
        "cli/study/test_verbs.py",
        "its case [missing]; runner/study/test_integrity.py",
        "test_a_lock_file_that_does_not_fit_is_one_line_and_can_be_written_again[of an older version]",
        "test_a_lock_file_that_does_not_fit_is_one_line_and_can_be_written_again[of another record]",
    ),
    **_of(
        "web/test_text_goal_study.py",
        "cli/study/test_verbs.py, runner/study/test_output_redaction.py",
        "test_text_goals_are_studied_blind",
    ),
    **_of(
        "simulator/generated_sites/test_generate.py",
        "its case [0]; site_checks/test_check.py",
        "test_nothing_hangs_over_a_doorway",
        "test_a_site_that_fails_the_check_is_never_returned",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[1000]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[1001]",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[10001]",
    ),
    **_of(
        "training/test_expert.py",
        "training/test_rollout.py",
        "test_following_it_reaches_the_goal_in_about_as_few_actions_as_the_planner[chair]",
    ),
    **_of(
        "training/test_explorer.py",
        "training/test_rollout.py",
        "test_it_finds_goals_that_are_not_in_view_at_the_start[sofa]",
    ),
    **_of(
        "runner/executors/test_served_workers.py",
        "models/remote/test_sessions.py",
        "test_more_workers_than_sessions_are_refused_in_one_line[batch0]",
    ),
    **_of(
        "web/site_editor/test_editor.py",
        "web/site_editor/test_editor.py::test_a_wall_is_drawn_moved_undone_and_saved_by_keyboard",
        "test_the_page_is_accessible",
    ),
    **_of(
        "web/site_editor/test_goals.py",
        "web/site_editor/test_goals.py::test_goals_are_edited_with_keys_undone_and_checked_where_they_stand",
        "test_a_photo_of_an_incomplete_goal_is_stored_under_a_safe_name",
    ),
    **_of(
        "statistics/test_power_independent.py",
        "its other tests",
        "test_independent_trials_needed_give_the_exact_power_asked_for",
    ),
    **_of(
        "runtime/test_numba_cache.py",
        "its other tests",
        "test_without_a_home_every_process_finds_what_the_first_has_compiled",
    ),
    **_of(
        "sensing/test_mover.py",
        "its cases [0.05-0.002-20] and [0.03-0.001-50]",
        "test_a_base_with_noise_at_rest_moves_accurately[0.03-0.001-20]",
        "test_a_base_with_noise_at_rest_moves_accurately[0.01-0.0005-50]",
        "test_a_base_with_noise_at_rest_moves_accurately[0.05-0.002-50]",
        "test_a_base_with_noise_at_rest_moves_accurately[0.01-0.0005-20]",
    ),
    # Cases that run the code of one that stays, with other numbers.
    **_of(
        "simulator/rendering/test_shading.py",
        "its case [pose0]",
        "test_surface_pixels_equal_scalar_arithmetic[pose1]",
        "test_surface_pixels_equal_scalar_arithmetic[pose2]",
    ),
    **_of(
        "sensing/test_lab_robots.py",
        "its cases [spot], [stretch] and [turtlebot4]",
        "test_twenty_movements_are_done[go2]",
        "test_twenty_movements_are_done[jackal]",
        "test_twenty_movements_are_done[limo]",
    ),
    **_of(
        "sensing/test_mover.py",
        "its case [0.1-True-20]",
        "test_true_is_within_tolerance_of_the_heading_that_is_held[0.1-True-50]",
        "test_true_is_within_tolerance_of_the_heading_that_is_held[0.0-True-50]",
    ),
    **_of(
        "models/baselines/test_oracle.py",
        "its case [chair]; golden/test_golden.py",
        "test_the_oracle_reaches_every_goal_and_from_every_start_some[sofa]",
        "test_the_oracle_reaches_every_goal_and_from_every_start_some[monitor]",
        "test_the_oracle_reaches_every_goal_and_from_every_start_some[plant]",
    ),
    **_of(
        "results/reading/test_queries.py",
        "its cases of SQLite, its case [postgresql-which0-found0]",
        *(f"test_a_filter_finds[postgresql-which{number}-found{number}]" for number in range(1, 12)),
    ),
    **_of(
        "results/studies/test_log.py",
        "its other cases",
        "test_a_merge_unites_two_logs_and_keeps_the_sign_of_a_deleted_event[sqlite-]",
    ),
    **_of(
        "models/remote/test_websockets_versions.py",
        "its case [17]",
        "test_a_model_in_another_environment_answers[11]",
    ),
    **_of(
        "cli/judging/test_judge.py",
        "its case [y-2]",
        "test_a_change_of_a_standing_verdict_is_asked_back_on_a_terminal[n-1]",
    ),
    **_of(
        "cli/study/test_verbs.py",
        "its case [missing]; runner/study/test_integrity.py",
        "test_a_lock_file_that_does_not_fit_is_one_line_and_can_be_written_again[of another study]",
    ),
    **_of(
        "models/remote/test_checking.py",
        "its case [objectgoal]",
        "test_a_habitat_agent_of_each_kind_of_goal_passes_everything[imagegoal]",
        "test_a_habitat_agent_of_each_kind_of_goal_passes_everything[instruction]",
    ),
    **_of(
        "fuzz/test_fuzz.py",
        "errors/test_files.py, `make fuzz`",
        "test_nothing_gets_past_a_loader_s_boundary[protocol]",
        "test_nothing_gets_past_a_loader_s_boundary[study]",
        "test_nothing_gets_past_a_loader_s_boundary[map]",
        "test_nothing_gets_past_a_loader_s_boundary[model settings]",
        "test_nothing_gets_past_a_loader_s_boundary[configuration]",
    ),
    **_of(
        "statistics/test_permutation.py",
        "its cases [0.02] and [1.0]",
        "test_equal_models_are_found_different_at_most_so_often_as_promised[4.0]",
        "test_equal_models_are_found_different_at_most_so_often_as_promised[1000000.0]",
    ),
    **_of(
        "statistics/test_power.py",
        "its case [0.25]",
        "test_of_single_episodes_it_is_the_exact_power_of_mcnemars_test[0.1]",
        "test_of_single_episodes_it_is_the_exact_power_of_mcnemars_test[0.4]",
    ),
    **_of(
        "statistics/test_prediction_powered.py",
        "its cases [0.3-0.6] and [0.5-0.95]",
        "test_it_covers_as_often_as_promised_whatever_the_simulator_is_worth[0.3-0.0]",
        "test_it_covers_as_often_as_promised_whatever_the_simulator_is_worth[0.3-0.95]",
        "test_it_covers_as_often_as_promised_whatever_the_simulator_is_worth[0.5-0.0]",
        "test_it_covers_as_often_as_promised_whatever_the_simulator_is_worth[0.5-0.6]",
    ),
    **_of(
        "study/test_power.py",
        "its cases [0.3-2] and [0.95-5]",
        *(
            f"test_arms_that_differ_by_position_and_not_on_average_are_rarely_told_apart[{case}]"
            for case in ("0.3-1", "0.3-5", "0.95-1", "0.95-2")
        ),
    ),
    **_of(
        "sensing/images/test_floor_plane.py",
        "its case [{'tilt_deg': 5.0}]",
        "test_the_mount_is_measured_in_the_simulated_apartment[{}]",
        "test_the_mount_is_measured_in_the_simulated_apartment[{'tilt_deg': -2.0}]",
        "test_the_mount_is_measured_in_the_simulated_apartment[{'mount_height_m': 0.5}]",
    ),
    **_of(
        "examples/test_examples.py",
        "its case [widest_opening:WidestOpening]; its tests of the same examples in a run",
        "test_the_examples_pass_models_check[velocity:Reactive]",
        "test_the_examples_pass_models_check[instruction:KeywordFollower]",
    ),
    **_of(
        "docs/test_commands.py",
        "its case [robots.md]; models/stack, ros/ros2/test_stack.py",
        "test_the_commands_of_a_page_succeed_in_order[stacks.md]",
    ),
    **_of(
        "runner/setup/test_trial_setup.py",
        "its other cases",
        "test_a_model_that_hangs_in_close_is_interrupted_or_ended[sys.exit(0)-0-the run goes on\\n-failed in close: "
        "SystemExit: 0]",
    ),
    **_of(
        "interop/test_merge_files.py",
        "its case [truncated]",
        "test_damaged_images_are_named_and_nothing_comes_in[link]",
        "test_damaged_images_are_named_and_nothing_comes_in[deleted colour]",
    ),
    **_of(
        "report/tables/test_headline.py",
        "its cases [models0-all-counts0] and [models1-shared-counts1]",
        "test_one_rate_of_several_models_is_over_the_same_goals_or_says_so[models2-shared-counts2]",
        "test_one_rate_of_several_models_is_over_the_same_goals_or_says_so[models3-own goals-counts3]",
    ),
    **_of(
        "robots/test_ros1_tf.py",
        "ros/ros2/test_tf.py, sensing/odometry/test_transform_chain.py",
        "test_a_base_is_driven_by_the_odometry_of_its_frames",
    ),
    **_of(
        "robots/test_ros1_run.py",
        "robots/test_ros1.py::test_a_camera_that_fails_is_a_lost_sensor, runner/episode/test_episode.py",
        "test_a_silent_camera_makes_the_episode_void_and_the_run_gives_advice",
    ),
    **_of(
        "robots/test_ros1.py",
        "its cases [silent-...] and [yuv-...]; robots/ros/test_image_timing.py",
        "test_a_camera_that_fails_is_a_lost_sensor[blind-no-image-/camera/depth/image_raw]",
        "test_a_camera_that_fails_is_a_lost_sensor[small-wrong-image-size-32x24]",
        "test_a_camera_that_fails_is_a_lost_sensor[past-no-matching-images-/camera/color/image_raw]",
    ),
    **_of(
        "robots/test_ros1.py",
        "its other cases; sensing/test_mover_faults.py, ros/ros2/test_faults.py",
        "test_a_base_that_fails_during_a_movement_stops_with_a_reason[nan-odometry is not finite-True]",
        "test_a_base_that_fails_during_a_movement_stops_with_a_reason[jump-odometry jumped-True]",
        "test_a_base_that_fails_during_a_movement_stops_with_a_reason[cliff-cliff (left)-False]",
    ),
    **_of(
        "robots/test_ros1.py",
        "robots/test_ros1_drive.py::test_a_lost_server_stops_the_base",
        "test_a_hanging_server_is_detected_during_a_movement_and_the_base_stopped",
    ),
    **_of(
        "robots/test_ros1_drive.py",
        "its other cases; ros/ros2/test_drive.py, sensing/test_difficult_bases.py",
        "test_a_movement_ends_where_it_was_asked_to[move]",
        "test_a_movement_ends_where_it_was_asked_to[sidestep]",
        "test_a_fault_of_the_base_ends_a_movement_in_flight[waypoint-silent]",
        "test_a_lost_server_stops_the_base[waypoint-9]",
    ),
    **_of(
        "ros/ros1/test_discrete_move.py",
        "its other cases; sensing/test_mover_faults.py",
        "test_a_fault_during_a_movement_is_false_and_zero_velocity[nan-odometry is not finite]",
        "test_a_fault_during_a_movement_is_false_and_zero_velocity[jump-odometry jumped]",
        "test_a_fault_during_a_movement_is_false_and_zero_velocity[cliff-cliff (left)]",
        "test_a_server_that_is_ended_stops_the_base_first[2]",
    ),
    **_of(
        "ros/ros1/test_discrete_move.py",
        "sensing/test_mover.py, ros/ros1/test_discrete_move.py::test_a_movement_meets_the_tolerances_of_the_paper",
        "test_turns_add_up_and_do_not_drift",
    ),
    **_of(
        "robots/test_calibration.py",
        "its case [compressed]; ros/ros2/test_calibration.py",
        "test_a_profile_is_corrected_over_ros1[raw]",
    ),
    **_of(
        "cli/robots/test_doctor.py",
        "its other cases; robots/checkup/test_listening.py",
        "test_a_broken_part_is_named_with_what_to_do[camera-silent-/camera/color/image_raw-failed-silent for]",
    ),
    **_of(
        "runner/judging/test_faces.py",
        "its other cases",
        *(
            f"test_an_answer_has_the_same_checks_and_verdict_everywhere[given{number}-expected{number}]"
            for number in (1, 2, 4, 6)
        ),
    ),
    **_of(
        "models/vlv/test_policy.py",
        "its other cases",
        *(
            f"test_hard_frames_neither_break_it_nor_send_it_into_a_wall[{case}]"
            for case in ("behind dropouts like glass", "at the lower right corner", "over the whole image")
        ),
    ),
    **_of(
        "simulator/generated_sites/test_generate.py",
        "simulator/generated_sites/test_generate.py::test_no_two_seeds_give_the_same_flat",
        "test_flats_differ_in_rooms_instances_models_and_colours",
    ),
    **_of("simulator/generated_sites/test_generate.py", "its case [2]", "test_the_oracle_reaches_every_goal[10000]"),
    **_of(
        "cli/robots/test_doctor.py",
        "robots/checkup/test_images.py, robots/checkup/test_checks.py, ros/ros2/test_hazard_topics.py",
        "test_a_broken_part_is_named_with_what_to_do[camera-small-depth image-failed-32x24; the profile has 64x48]",
        "test_a_profile_that_names_another_topic_or_type_is_noticed",
    ),
    **_of(
        "ros/ros1/test_node.py",
        "its case [a signal]",
        "test_the_last_command_of_an_ended_node_is_sent[another of its name]",
    ),
    **_of(
        "cli/study/test_verbs.py",
        "its case [False]; runner/study/test_integrity.py",
        "test_a_plan_that_was_changed_in_the_record_is_named_by_its_line[True]",
    ),
    **_of(
        "runner/executors/test_process.py",
        "runner/executors/test_process.py::test_workers_of_an_ended_fork_server_are_reported_as_killed",
        "test_a_killed_fork_server_leaves_no_zombies",
    ),
    **_of(
        "robots/test_simulated.py",
        "runner/executors/test_local_pool.py::test_two_workers_give_the_same_bits_as_one",
        "test_another_process_measures_and_sees_the_same",
    ),
    **_of(
        "simulator/rendering/test_renderer.py",
        "runner/executors/test_local_pool.py::test_two_workers_give_the_same_bits_as_one, golden/test_golden.py",
        "test_pixels_are_the_same_on_every_run_and_in_every_process",
    ),
    **_of(
        "cli/results/test_results_paths.py",
        "its other case",
        "test_a_path_that_is_not_utf8_is_refused_in_one_line[(b'verify',)]",
    ),
    **_of(
        "robots/test_ros1_run.py",
        "runner/operator/test_terminal.py",
        "test_without_a_terminal_a_robot_that_needs_an_operator_is_refused",
    ),
    # Some live tests of each generation of ROS stay; the other generation, or code without a graph, tests the rest.
    **_of(
        "ros/ros2/test_drive.py",
        "robots/test_ros1_drive.py",
        "test_a_movement_ends_where_it_was_asked_to[workstation-waypoint]",
        "test_a_fault_of_the_base_ends_a_movement_in_flight[workstation-waypoint-silent]",
        "test_a_fault_of_the_base_ends_a_movement_in_flight[workstation-velocity-stuck]",
        "test_a_silent_camera_blocks_a_movement_in_flight[workstation-waypoint]",
        "test_a_fault_of_the_base_ends_driving_on[next to the base-bumper]",
    ),
    **_of(
        "ros/ros2/test_faults.py",
        "robots/test_ros1.py",
        "test_a_fault_in_a_movement_stops_the_base[workstation-silent-no odometry-True]",
        "test_a_fault_in_a_movement_stops_the_base[next to the base-bumper-bumper-False]",
        "test_a_fault_in_a_movement_stops_the_base[next to the base-stuck-the base does not follow its commands-False]",
        "test_another_publisher_ends_a_movement_at_once[workstation]",
        "test_a_camera_that_fails_is_a_lost_sensor[blind-no-image-workstation]",
        "test_a_killed_discrete_move_is_detected_and_a_restarted_one_moves[next to the base]",
    ),
    **_of(
        "ros/ros2/test_run.py",
        "ros/ros2/test_faults.py::test_a_base_stops_when_the_workstation_is_killed, robots/test_rehearsal.py",
        "test_the_rehearsal_takes_the_same_actions_as_the_simulation",
    ),
    **_of(
        "ros/ros2/test_hazard_topics.py",
        "cli/robots/test_doctor_hazards.py",
        "test_doctor_and_a_session_say_that_a_bumper_topic_is_misspelt",
    ),
    **_of(
        "ros/ros2/test_calibration.py",
        "robots/test_calibration.py",
        "test_a_profile_is_corrected_over_ros2[raw]",
        "test_the_doctor_looks_at_the_camera_over_ros2[finds_the_camera_askew]",
    ),
    **_of(
        "ros/ros2/test_doctor.py",
        "cli/robots/test_doctor.py",
        "test_doctor_fails_with_bad_odometry_or_a_pressed_bumper[bumper-the base reports: bumper]",
    ),
    **_of(
        "ros/ros2/test_other_vendor.py",
        "ros/ros2/test_exchange.py",
        "test_a_robot_of_another_vendors_dds_sees_and_drives",
    ),
    **_of(
        "robots/test_ros1_network.py",
        "ros/ros1/test_service_call.py, ros/ros1/test_master.py",
        "test_a_server_that_replaces_ours_is_another_campaign",
        "test_a_second_server_of_another_name_is_refused_and_names_the_first",
        "test_a_restarted_master_is_reported_at_once",
    ),
    **_of(
        "robots/test_ros1_drive.py",
        "ros/ros2/test_drive.py",
        "test_a_movement_ends_where_it_was_asked_to[trajectory]",
    ),
    # What is looked at in a browser, and is tested in one process too.
    **_of(
        "web/driver/test_driver_page_in_browser.py",
        "web/driver/test_driver_page.py",
        "test_the_page_says_when_the_run_is_gone",
    ),
    **_of(
        "web/results_browser/test_website.py",
        "web/results_browser/test_website.py::test_episodes_open_as_files",
        "test_films_play_from_files",
        "test_pictures_are_left_out_until_a_single_file_fits",
    ),
    **_of(
        "cli/running/test_run_with_a_person.py",
        "runner/operator/test_prompts.py, runner/operator/test_answers.py",
        "test_what_a_person_types_is_the_verdict_and_enter_is_none",
    ),
    **_of(
        "localization/test_matching.py",
        "runner/episode/test_stop_measurement.py::test_facing_a_bare_wall_the_place_along_it_is_unknown_and_the_odometry_stays",
        "test_a_bare_wall_does_not_determine_left_and_right_but_a_turn_does",
    ),
    **_of(
        "localization/test_matching.py",
        "robots/test_pitching_body.py",
        "test_each_look_of_a_body_that_leans_has_its_own_camera",
    ),
    **_of(
        "runner/episode/test_stop_measurement.py",
        "runner/episode/test_stop_measurement.py::test_after_stop_a_robot_is_judged_by_the_pose_that_its_images_determine",
        "test_a_person_can_ask_during_a_trial_where_the_robot_is",
    ),
    **_of(
        "report/test_figure_layout.py",
        "report/test_figure_layout.py::test_success_and_failure_end_at_their_shares_of_all_episodes",
        "test_every_condition_is_in_some_figure_and_what_is_left_out_is_said",
    ),
    **_of(
        "cli/results/test_report.py",
        "report/test_forms.py",
        "test_each_table_is_a_file_to_paste_and_is_chosen_by_name",
    ),
    **_of(
        "cli/running/test_stress.py",
        "report/comparison/test_stress.py, golden/test_golden.py",
        "test_trials_of_another_goal_in_the_record_are_neither_done_nor_in_the_result",
    ),
    **_of(
        "interop/test_merge.py",
        "results/merging/test_studies.py, interop/test_merge_files.py",
        "test_a_file_becomes_part_of_a_servers_record_and_comes_back",
    ),
    **_of(
        "cli/test_sweep.py",
        "runner/setup/test_sweep.py",
        "test_a_sweep_is_run_reported_and_gone_on_with_like_any_run",
    ),
    **_of(
        "cli/judging/test_second_judge.py",
        "web/second_judgement/test_second_judgement_app.py",
        "test_answers_by_number_are_reported_with_their_differences",
    ),
    **_of(
        "models/remote/test_sessions.py",
        "models/remote/test_checking.py",
        "test_models_check_finds_sessions_that_mix",
    ),
    **_of(
        "fuzz/test_fuzz.py",
        "simulator/scan/test_splat_files.py, cli/test_site_scan.py",
        "test_nothing_gets_past_a_loader_s_boundary[splat ply]",
        "test_nothing_gets_past_a_loader_s_boundary[spz]",
        "test_nothing_gets_past_a_loader_s_boundary[obj]",
    ),
    **_of(
        "web/site_editor/test_scan.py",
        "cli/test_site_scan.py::test_floor_and_walls_of_an_imperfect_scan_are_recovered",
        "test_edit_makes_a_new_site_from_a_scan",
    ),
    **_of(
        "cli/test_site_scan.py",
        "simulator/scan/test_comparison.py, simulator/rendering/scan/test_splats.py",
        "test_trials_in_the_scan_succeed",
    ),
    **_of(
        "examples/test_examples.py",
        "models/test_contract_check.py",
        "test_the_examples_pass_models_check[sequence:Rememberer]",
    ),
    **_of(
        "cli/study/test_verbs.py",
        "study/test_planned_twin.py",
        "test_a_planned_twin_is_run_by_the_study_before_the_first_real_trial",
    ),
    **_of(
        "results/test_goals.py",
        "results/test_goals.py::test_a_sequence_is_recorded_reported_merged_and_verified_leg_by_leg",
        "test_sequences_have_oracle_success_and_the_share_of_goals_reached",
    ),
    **_of(
        "robots/test_calibration.py",
        "sensing/images/test_floor_plane.py",
        "test_the_doctor_looks_at_the_camera_over_ros1[survives_an_unnamed_compressed_topic]",
    ),
    **_of(
        "cli/running/test_stress.py",
        "golden/test_golden.py (stress), runner/disturbances, report/comparison/test_stress.py",
        "test_a_stress_test_runs_pairs_and_states_each_loss",
    ),
    **_of(
        "web/results_browser/test_website.py",
        "its test of episodes without a server",
        "test_a_single_file_shows_all_of_a_record_without_a_request",
    ),
    **_of(
        "interop/test_cameras.py",
        "its test of the images that a website and a single file have",
        "test_a_website_and_a_single_file_have_the_images_of_each_camera",
    ),
    **_of(
        "fuzz/test_fuzz.py",
        "its cases of the other loaders; simulator/rendering/scan",
        "test_nothing_gets_past_a_loader_s_boundary[glb]",
        "test_nothing_gets_past_a_loader_s_boundary[ply]",
    ),
    **_of(
        "cli/test_missing_extras.py",
        "its other cases",
        "test_a_verb_says_which_extra_it_wants[postgresql-psycopg-episodes]",
    ),
    **_of(
        "examples/test_adapters.py",
        "its tests of the other adapters, of which each has one",
        "test_goats_agent_keeps_its_memory_from_goal_to_goal",
        "test_an_episode_of_unigoal_that_ends_without_stop_leaves_room_for_the_next",
        "test_servers_that_keep_images_forget_them_between_episodes[gnm]",
    ),
    **_of(
        "simulator/rendering/scan/test_splats.py",
        "its other tests",
        "test_opaque_splats_hide_what_is_behind_them_in_any_order",
    ),
    **_of(
        "cli/running/test_try.py",
        "its test of a model that never stops, and its cases of answers in another unit",
        "test_a_model_that_turns_for_ever_may_have_a_wrong_unit",
        "test_degrees_that_are_possible_radians_are_noticed",
        "test_a_model_that_is_blocked_is_told_where",
    ),
    **_of(
        "cli/running/test_run_continuous.py",
        "evidence/verification/test_verify.py::test_an_intact_record_holds_and_episodes_driven_again_are_identical",
        "test_what_was_driven_is_verified_and_driven_again_bit_for_bit",
    ),
    **_of(
        "cli/models/test_models.py",
        "its tests of a check for scripts and of fetched weights",
        "test_a_check_prints_each_result_as_it_is_known_and_json_in_one_piece[option1-shown == '']",
        "test_a_check_says_what_is_in_the_weights_and_how_the_engines_compare",
    ),
    **_of(
        "cli/models/test_models_cards.py",
        "its test of a check that has the kinds",
        "test_a_check_of_weights_warns_of_other_steps_than_the_protocol_s",
    ),
    **_of(
        "statistics/sequential/test_betting.py",
        "its tests against fractions and of every order",
        "test_the_confidence_sequence_covers_the_mean_of_values_and_converges",
    ),
    **_of(
        "statistics/sequential/test_group_sequential.py",
        "its test of the last look",
        "test_up_to_every_look_at_most_the_spent_share_of_every_level_is_rejected",
    ),
    **_of(
        "statistics/test_power_independent.py",
        "its test of the trials that are needed",
        "test_power_of_independent_samples_counts_every_table",
    ),
    **_of(
        "training/test_rollout.py",
        "training/test_run.py, training/test_expert.py",
        "test_demonstrations_are_knocked_off_their_way_and_still_end_with_stop",
    ),
    **_of(
        "training/test_explorer.py",
        "training/test_run.py",
        "test_it_finds_goals_that_are_not_in_view_at_the_start[bed]",
    ),
    **_of(
        "models/vlv/test_policy.py",
        "its other cases",
        "test_hard_frames_neither_break_it_nor_send_it_into_a_wall[through a door]",
    ),
    **_of(
        "simulator/generated_sites/test_generate.py",
        "its other cases",
        "test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for[3]",
    ),
    **_of(
        "robots/test_simulated.py",
        "its other cases",
        "test_of_many_actions_every_move_is_within_5_mm[turtlebot2-believed]",
    ),
    **_of(
        "evidence/verification/test_page.py",
        "evidence/verification/test_verify.py, web/results_browser/test_page_in_browser.py",
        "test_everybody_can_read_the_page_and_the_browser_reports_no_error",
    ),
    **_of(
        "sensing/test_mover.py",
        "its other cases",
        "test_a_base_with_noise_at_rest_moves_accurately[0.05-0.002-20]",
        "test_true_is_within_tolerance_of_the_heading_that_is_held[0.1-False-10]",
    ),
    **_of(
        "cli/robots/test_doctor.py",
        "robots/checkup/test_checks.py, sensing/test_topic_monitor.py",
        "test_a_broken_part_is_named_with_what_to_do[base-silent-/odom-failed-silent for]",
    ),
    **_of(
        "cli/robots/test_doctor_hazards.py",
        "ros/ros1/test_hazard_events.py, robots/test_ros1.py::test_a_bumper_is_a_collision",
        "test_a_session_knows_a_bumper_of_a_kobuki_that_was_pressed_before",
    ),
    **_of(
        "robots/test_ros1.py",
        "its other cases; sensing/test_mover_faults.py, ros/ros2/test_faults.py",
        "test_a_base_that_fails_during_a_movement_stops_with_a_reason[drop-wheel drop (left)-False]",
        "test_a_base_that_fails_during_a_movement_stops_with_a_reason[stuck-does not follow-False]",
        "test_a_camera_that_fails_is_a_lost_sensor[silent-no-image-/camera/color/image_raw and "
        "/camera/depth/image_raw]",
        "test_another_publisher_ends_a_movement_at_once_and_the_base_is_held",
    ),
    **_of(
        "robots/test_ros1_drive.py",
        "its other cases; sensing/test_path_driver.py, robots/ros/test_path_looks.py",
        "test_a_silent_depth_camera_blocks_a_movement_in_flight[waypoint]",
        "test_a_fault_of_the_base_ends_a_movement_in_flight[velocity-stuck]",
    ),
    **_of(
        "robots/test_ros1_drive.py",
        "ros/ros2/test_driving_on.py",
        "test_a_fault_of_the_base_ends_driving_on[bumper]",
    ),
    **_of(
        "ros/ros1/test_discrete_move.py",
        "sensing/test_mover.py, and its other cases",
        "test_a_base_turned_by_hand_turns_from_its_present_heading",
        "test_a_movement_meets_the_tolerances_of_the_paper[Backward-0--0.25-0]",
        "test_a_movement_meets_the_tolerances_of_the_paper[Right-45-0--45]",
        "test_a_fault_during_a_movement_is_false_and_zero_velocity[drop-wheel drop (left)]",
        "test_a_fault_during_a_movement_is_false_and_zero_velocity[stuck-does not follow]",
    ),
    **_of(
        "ros/ros1/test_node.py",
        "its tests of a closed connection and of the last command",
        "test_a_node_ends_although_its_master_does_not_answer",
    ),
    **_of(
        "ros/ros2/test_cameras.py",
        "robots/test_cameras.py, robots/ros/test_image_timing.py",
        "test_images_30_ms_apart_are_paired_and_60_ms_apart_refused",
    ),
    **_of(
        "ros/ros2/test_faults.py",
        "its other cases; robots/test_ros1.py::test_a_camera_that_fails_is_a_lost_sensor, sensing/test_mover_faults.py",
        "test_a_camera_that_fails_is_a_lost_sensor[small-wrong-image-size-workstation]",
        "test_a_fault_in_a_movement_stops_the_base[next to the base-nan-odometry is not finite-True]",
        "test_a_fault_in_a_movement_stops_the_base[workstation-cliff-cliff (cliff_front_left)-False]",
    ),
    **_of(
        "ros/ros2/test_bad_input.py",
        "ros/ros2/test_graph.py, and its other cases",
        "test_a_robot_in_another_domain_is_waited_for",
    ),
    **_of(
        "ros/ros2/test_undock.py",
        "its test of an interrupt",
        "test_the_result_of_the_action_is_reported[leaves-0-the robot has left its dock]",
    ),
    **_of(
        "ros/ros2/test_stack.py",
        "ros/ros2/test_faults.py::test_a_base_stops_when_the_workstation_is_killed",
        "test_a_killed_run_leaves_a_robot_at_rest",
    ),
    **_of(
        "ros/ros2/test_tf.py",
        "sensing/odometry/test_transform_chain.py",
        "test_a_base_is_driven_by_the_odometry_of_its_frames",
    ),
    **_of(
        "ros/ros2/test_drive.py",
        "ros/ros2/test_faults.py::test_a_fault_in_a_movement_stops_the_base",
        "test_a_fault_of_the_base_ends_a_movement_in_flight[next to the base-waypoint-bumper]",
    ),
    **_of(
        "cli/running/test_stress.py",
        "runner/disturbances/test_fit.py",
        "test_a_disturbance_that_the_model_cannot_see_is_left_out_and_named_before_the_trials",
    ),
    **_of(
        "interop/lerobot/test_dataset.py",
        "its test of the words of the goals, which loads a dataset",
        "test_info_has_every_field_of_the_loader",
        "test_statistics_are_those_of_numpy",
    ),
    **_of(
        "results/test_goals.py",
        "results/test_campaigns.py",
        "test_a_changed_goal_is_refused_in_its_campaign_and_not_pooled_with_others",
    ),
    **_of(
        "report/comparison/test_compare.py",
        "its other tests; report/comparison/test_question.py",
        "test_numbers_of_actions_are_compared_only_between_models_of_one_kind",
        "test_effects_are_resampled_by_starting_position",
    ),
    **_of(
        "simulator/generated_sites/test_generate.py",
        "its other cases",
        "test_no_two_seeds_give_the_same_flat[5]",
    ),
    **_of(
        "evidence/bundle/test_make.py",
        "its other tests",
        "test_a_study_is_bundled_with_its_plan_log_and_report",
        "test_scans_are_added_only_when_asked_for",
        "test_a_title_with_html_stays_text",
    ),
    **_of(
        "models/remote/test_serving.py",
        "its other cases",
        "test_an_isolated_model_that_dies_or_hangs_is_lost_and_started_again[3-SIGSEGV]",
        "test_the_same_source_is_the_same_model_in_this_process_and_in_its_own[python1]",
    ),
    **_of(
        "sensing/test_difficult_bases.py",
        "its other cases",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[very late-trajectory]",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[late-turn]",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[noisy-waypoint]",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[slow odometry-session]",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[very late-move]",
        "test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time[noisy-sidestep]",
    ),
    **_of(
        "models/remote/test_checking.py",
        "its test of a good server",
        "test_a_model_that_says_it_is_not_deterministic_may_differ",
        "test_a_server_that_needs_a_task_and_takes_photographs_passes_everything",
    ),
    **_of(
        "models/test_contract_check.py",
        "its other cases",
        "test_a_model_receives_the_words_of_its_own_vocabulary[words1]",
        "test_a_model_of_one_kind_of_goal_receives_goals_of_this_kind[point]",
        "test_a_model_of_one_kind_of_goal_receives_goals_of_this_kind[route]",
        "test_a_model_of_one_kind_of_goal_receives_goals_of_this_kind[text]",
    ),
    **_of(
        "examples/test_frontier.py",
        "models/test_contract_check.py, and its other tests",
        "test_the_follower_turns_passes_one_thing_and_stops_at_the_next",
    ),
    **_of(
        "sensing/test_lab_robots.py",
        "its other cases",
        "test_twenty_movements_are_done[stretch]",
    ),
    **_of(
        "evidence/verification/test_verify.py",
        "its other cases",
        "test_changed_cells_that_other_rows_or_files_contradict_are_named[episodes/000002/rgb/0001.jpg]",
        "test_a_flipped_byte_of_an_unpacked_bundle_is_named[tables/steps.csv]",
    ),
    **_of(
        "web/results_browser/test_page_in_browser.py",
        "its other tests; web/results_browser/test_app.py",
        "test_an_episode_shows_the_images_of_each_camera",
        "test_previous_and_next_follow_the_order_of_the_results",
    ),
    **_of(
        "web/operator/test_page_in_browser.py",
        "web/operator/test_page.py, and its test of an episode that is judged by keyboard",
        "test_an_open_form_closes_when_another_operator_judges_the_episode",
    ),
    **_of(
        "training/test_rollout.py",
        "training/test_run.py",
        "test_what_is_in_view_is_told_with_its_nearness",
    ),
}
