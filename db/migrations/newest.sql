-- Written by scripts/make_docs.py from the migrations.
BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0013');
CREATE TABLE "campaign" (
	id INTEGER NOT NULL, 
	"key" TEXT NOT NULL, 
	name TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	site_id INTEGER NOT NULL, 
	robot_id INTEGER NOT NULL, 
	model_id INTEGER NOT NULL, 
	process_id INTEGER NOT NULL, 
	protocol JSON NOT NULL, 
	protocol_sha256 TEXT NOT NULL, 
	conditions JSON NOT NULL, 
	seed BIGINT NOT NULL, 
	CONSTRAINT pk_campaign PRIMARY KEY (id), 
	CONSTRAINT fk_campaign_model_id_model FOREIGN KEY(model_id) REFERENCES model (id), 
	CONSTRAINT fk_campaign_site_id_site FOREIGN KEY(site_id) REFERENCES site (id), 
	CONSTRAINT uq_campaign_key UNIQUE ("key"), 
	CONSTRAINT fk_campaign_process_id_process FOREIGN KEY(process_id) REFERENCES process (id), 
	CONSTRAINT fk_campaign_robot_id_robot FOREIGN KEY(robot_id) REFERENCES robot (id)
);
CREATE TABLE "episode" (
	id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	uuid TEXT NOT NULL, 
	trial_id INTEGER NOT NULL, 
	process_id INTEGER NOT NULL, 
	origin TEXT NOT NULL, 
	seed BIGINT NOT NULL, 
	started_at DATETIME NOT NULL, 
	ended_at DATETIME, 
	end_reason TEXT, 
	error TEXT NOT NULL, 
	actions INTEGER NOT NULL, 
	path_length_m DOUBLE, 
	geodesic_start_m DOUBLE, 
	geodesic_end_m DOUBLE, 
	duration_s DOUBLE, 
	wall_duration_s DOUBLE, 
	distance_to_goal_m DOUBLE, 
	distance_source TEXT, 
	goal_instance TEXT, 
	start_x_m DOUBLE, 
	start_y_m DOUBLE, 
	start_heading_rad DOUBLE, 
	final_x_m DOUBLE, 
	final_y_m DOUBLE, 
	final_heading_rad DOUBLE, 
	final_source TEXT, 
	images_directory TEXT NOT NULL, 
	state TEXT NOT NULL, 
	lease_until DATETIME, 
	start_source TEXT, 
	goal_in_sight BOOLEAN, session_id INTEGER CONSTRAINT fk_episode_session_id_session REFERENCES session (id), thinking_s DOUBLE, legs JSON, 
	CONSTRAINT fk_episode_process_id_process FOREIGN KEY(process_id) REFERENCES process (id), 
	CONSTRAINT fk_episode_trial_id_trial FOREIGN KEY(trial_id) REFERENCES trial (id), 
	CONSTRAINT uq_episode_uuid UNIQUE (uuid), 
	CONSTRAINT ck_episode_ends_with_a_reason CHECK ((end_reason IS NULL) = (ended_at IS NULL)), 
	CONSTRAINT ck_episode_ck_episode_state_fits_the_end CHECK (state IN ('claimed', 'placed', 'running', 'awaiting', 'judged', 'void') AND (state IN ('claimed', 'placed', 'running')) = (end_reason IS NULL))
);
CREATE TABLE "event" (
	id INTEGER NOT NULL, 
	campaign_id INTEGER, 
	episode_id INTEGER, 
	step_number INTEGER, 
	created_at DATETIME NOT NULL, 
	kind TEXT NOT NULL, 
	text TEXT NOT NULL, 
	author TEXT NOT NULL, 
	CONSTRAINT pk_event PRIMARY KEY (id), 
	CONSTRAINT fk_event_episode_id_episode FOREIGN KEY(episode_id) REFERENCES episode (id), 
	CONSTRAINT fk_event_campaign_id_campaign FOREIGN KEY(campaign_id) REFERENCES campaign (id)
);
CREATE TABLE goal (
	id INTEGER NOT NULL, 
	sha256 TEXT NOT NULL, 
	name TEXT NOT NULL, 
	kind TEXT NOT NULL, 
	content JSON NOT NULL, 
	image BLOB, 
	CONSTRAINT pk_goal PRIMARY KEY (id), 
	CONSTRAINT uq_goal_sha256 UNIQUE (sha256)
);
CREATE TABLE "model" (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	sha256 TEXT NOT NULL, 
	weights_sha256 TEXT NOT NULL, 
	weights_label TEXT NOT NULL, 
	settings JSON NOT NULL, 
	goals JSON, 
	sensors JSON NOT NULL, 
	surveyed BOOLEAN NOT NULL, 
	files JSON NOT NULL, 
	code JSON NOT NULL, 
	CONSTRAINT pk_model PRIMARY KEY (id), 
	CONSTRAINT uq_model_sha256 UNIQUE (sha256)
);
CREATE TABLE "placement" (
	id INTEGER NOT NULL, 
	episode_id INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	author TEXT NOT NULL, 
	method TEXT NOT NULL, 
	looks INTEGER NOT NULL, 
	x_m DOUBLE NOT NULL, 
	y_m DOUBLE NOT NULL, 
	heading_rad DOUBLE NOT NULL, 
	covariance JSON NOT NULL, 
	ahead_m DOUBLE NOT NULL, 
	left_m DOUBLE NOT NULL, 
	turn_rad DOUBLE NOT NULL, 
	determined BOOLEAN NOT NULL, 
	within_tolerance BOOLEAN NOT NULL, 
	undetermined JSON NOT NULL, 
	moved JSON NOT NULL, 
	depth_scale DOUBLE NOT NULL, 
	words TEXT NOT NULL, 
	moment TEXT DEFAULT 'start' NOT NULL, 
	distance_m DOUBLE, 
	distance_low_m DOUBLE, 
	distance_high_m DOUBLE, 
	odometry_m DOUBLE, 
	odometry_low_m DOUBLE, 
	odometry_high_m DOUBLE, 
	verdicts_differ BOOLEAN, 
	CONSTRAINT pk_placement PRIMARY KEY (id), 
	CONSTRAINT fk_placement_episode_id_episode FOREIGN KEY(episode_id) REFERENCES episode (id), 
	CONSTRAINT uq_placement_episode_id_moment UNIQUE (episode_id, moment)
);
CREATE TABLE process (
	id INTEGER NOT NULL, 
	host TEXT NOT NULL, 
	pid INTEGER NOT NULL, 
	boot_id TEXT NOT NULL, 
	pid_namespace TEXT NOT NULL, 
	start_ticks BIGINT NOT NULL, 
	started_at DATETIME NOT NULL, 
	operator TEXT NOT NULL, 
	command TEXT NOT NULL, 
	vsnbench_version TEXT NOT NULL, 
	git_commit TEXT NOT NULL, 
	git_dirty BOOLEAN NOT NULL, 
	packages JSON NOT NULL, 
	platform JSON NOT NULL, 
	CONSTRAINT pk_process PRIMARY KEY (id)
);
CREATE TABLE released_claim (
	number INTEGER NOT NULL, 
	released_at DATETIME, 
	CONSTRAINT pk_released_claim PRIMARY KEY (number)
);
CREATE TABLE "robot" (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	title TEXT NOT NULL, 
	simulated BOOLEAN NOT NULL, 
	sha256 TEXT NOT NULL, 
	profile JSON NOT NULL, 
	kind TEXT NOT NULL, 
	CONSTRAINT pk_robot PRIMARY KEY (id), 
	CONSTRAINT uq_robot_sha256 UNIQUE (sha256)
);
CREATE TABLE session (
	id INTEGER NOT NULL, 
	uuid TEXT NOT NULL, 
	process_id INTEGER NOT NULL, 
	robot_id INTEGER NOT NULL, 
	operator TEXT NOT NULL, 
	began_at DATETIME NOT NULL, 
	ended_at DATETIME, 
	words TEXT NOT NULL, 
	CONSTRAINT pk_session PRIMARY KEY (id), 
	CONSTRAINT fk_session_process_id_process FOREIGN KEY(process_id) REFERENCES process (id), 
	CONSTRAINT fk_session_robot_id_robot FOREIGN KEY(robot_id) REFERENCES robot (id), 
	CONSTRAINT uq_session_uuid UNIQUE (uuid)
);
CREATE TABLE site (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	title TEXT NOT NULL, 
	sha256 TEXT NOT NULL, 
	content JSON NOT NULL, 
	CONSTRAINT pk_site PRIMARY KEY (id), 
	CONSTRAINT uq_site_sha256 UNIQUE (sha256)
);
CREATE TABLE step (
	episode_id INTEGER NOT NULL, 
	number INTEGER NOT NULL, 
	raw_action TEXT NOT NULL, 
	action TEXT NOT NULL, 
	blocked BOOLEAN NOT NULL, 
	completed BOOLEAN NOT NULL, 
	failure TEXT NOT NULL, 
	recorded_at DATETIME NOT NULL, 
	stamp_s DOUBLE, 
	observed_x_m DOUBLE, 
	observed_y_m DOUBLE, 
	observed_heading_rad DOUBLE, 
	after_x_m DOUBLE, 
	after_y_m DOUBLE, 
	after_heading_rad DOUBLE, 
	world_x_m DOUBLE, 
	world_y_m DOUBLE, 
	world_heading_rad DOUBLE, 
	world_source TEXT, 
	displacement_m DOUBLE, 
	turn_rad DOUBLE, 
	duration_s DOUBLE, 
	corrections INTEGER NOT NULL, 
	collision_source TEXT, 
	collision_touched TEXT, 
	rgb_digest TEXT, 
	depth_digest TEXT, 
	sense_s DOUBLE, 
	infer_s DOUBLE, 
	move_s DOUBLE, 
	probabilities JSON, 
	details JSON, movement JSON, rgb_file_digest TEXT, depth_file_digest TEXT, refusal TEXT NOT NULL DEFAULT '', 
	CONSTRAINT pk_step PRIMARY KEY (episode_id, number), 
	CONSTRAINT ck_step_number_from_one CHECK (number >= 1), 
	CONSTRAINT fk_step_episode_id_episode FOREIGN KEY(episode_id) REFERENCES episode (id)
)
 WITHOUT ROWID

;
CREATE TABLE study (
	id INTEGER NOT NULL, 
	uuid TEXT NOT NULL, 
	title TEXT NOT NULL, 
	content TEXT NOT NULL, 
	sha256 TEXT NOT NULL, 
	locked_sha256 TEXT NOT NULL, 
	schedule_sha256 TEXT NOT NULL, 
	seed BIGINT NOT NULL, 
	blind BOOLEAN NOT NULL, 
	locked_at DATETIME NOT NULL, 
	unblinded_at DATETIME, 
	process_id INTEGER NOT NULL, log_heads TEXT NOT NULL DEFAULT '', 
	CONSTRAINT pk_study PRIMARY KEY (id), 
	CONSTRAINT fk_study_process_id_process FOREIGN KEY(process_id) REFERENCES process (id), 
	CONSTRAINT uq_study_uuid UNIQUE (uuid)
);
CREATE TABLE study_arm (
	id INTEGER NOT NULL, 
	study_id INTEGER NOT NULL, 
	campaign_id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	code TEXT NOT NULL, 
	CONSTRAINT pk_study_arm PRIMARY KEY (id), 
	CONSTRAINT fk_study_arm_study_id_study FOREIGN KEY(study_id) REFERENCES study (id), 
	CONSTRAINT fk_study_arm_campaign_id_campaign FOREIGN KEY(campaign_id) REFERENCES campaign (id), 
	CONSTRAINT uq_study_arm_study_id_name UNIQUE (study_id, name), 
	CONSTRAINT uq_study_arm_study_id_code UNIQUE (study_id, code), 
	CONSTRAINT uq_study_arm_campaign_id UNIQUE (campaign_id)
);
CREATE TABLE study_entry (
	id INTEGER NOT NULL, 
	study_id INTEGER NOT NULL, 
	process_id INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	kind TEXT NOT NULL, 
	author TEXT NOT NULL, 
	reason TEXT NOT NULL, 
	text TEXT NOT NULL, 
	results INTEGER NOT NULL, 
	CONSTRAINT pk_study_entry PRIMARY KEY (id), 
	CONSTRAINT fk_study_entry_study_id_study FOREIGN KEY(study_id) REFERENCES study (id), 
	CONSTRAINT fk_study_entry_process_id_process FOREIGN KEY(process_id) REFERENCES process (id)
);
CREATE TABLE study_event (
	id INTEGER NOT NULL, 
	study_id INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	kind TEXT NOT NULL, 
	content TEXT NOT NULL, 
	previous TEXT NOT NULL, 
	sha256 TEXT NOT NULL, 
	CONSTRAINT pk_study_event PRIMARY KEY (id), 
	CONSTRAINT fk_study_event_study_id_study FOREIGN KEY(study_id) REFERENCES study (id), 
	CONSTRAINT uq_study_event_study_id_sha256 UNIQUE (study_id, sha256)
);
CREATE TABLE study_trial (
	id INTEGER NOT NULL, 
	study_id INTEGER NOT NULL, 
	trial_id INTEGER NOT NULL, 
	rank INTEGER NOT NULL, 
	block INTEGER NOT NULL, 
	CONSTRAINT pk_study_trial PRIMARY KEY (id), 
	CONSTRAINT fk_study_trial_study_id_study FOREIGN KEY(study_id) REFERENCES study (id), 
	CONSTRAINT fk_study_trial_trial_id_trial FOREIGN KEY(trial_id) REFERENCES trial (id), 
	CONSTRAINT uq_study_trial_study_id_rank UNIQUE (study_id, rank), 
	CONSTRAINT uq_study_trial_trial_id UNIQUE (trial_id)
);
CREATE TABLE "trial" (
	id INTEGER NOT NULL, 
	campaign_id INTEGER NOT NULL, 
	goal TEXT NOT NULL, 
	start INTEGER NOT NULL, 
	repetition INTEGER NOT NULL, 
	rank INTEGER NOT NULL, goal_id INTEGER CONSTRAINT fk_trial_goal_id_goal REFERENCES goal (id), 
	CONSTRAINT pk_trial PRIMARY KEY (id), 
	CONSTRAINT uq_trial_campaign_id_goal_start_repetition UNIQUE (campaign_id, goal, start, repetition), 
	CONSTRAINT fk_trial_campaign_id_campaign FOREIGN KEY(campaign_id) REFERENCES campaign (id), 
	CONSTRAINT ck_trial_repetition_from_one CHECK (repetition >= 1)
);
CREATE TABLE "verdict" (
	id INTEGER NOT NULL, 
	episode_id INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	success BOOLEAN, 
	end_reason TEXT NOT NULL, 
	distance_m DOUBLE, 
	distance_source TEXT, 
	goal_instance TEXT, 
	author TEXT NOT NULL, 
	source TEXT NOT NULL, 
	reason TEXT NOT NULL, 
	proposed BOOLEAN NOT NULL, 
	note TEXT NOT NULL, 
	goal_in_sight BOOLEAN, 
	CONSTRAINT pk_verdict PRIMARY KEY (id), 
	CONSTRAINT fk_verdict_episode_id_episode FOREIGN KEY(episode_id) REFERENCES episode (id)
);
CREATE INDEX ix_step_actions ON step (episode_id, raw_action, action, blocked);
CREATE INDEX ix_campaign_model_id ON campaign (model_id);
CREATE INDEX ix_campaign_site_id ON campaign (site_id);
CREATE INDEX ix_campaign_robot_id ON campaign (robot_id);
CREATE INDEX ix_verdict_episode_id_proposed_id ON verdict (episode_id, proposed, id);
CREATE INDEX ix_episode_process_id ON episode (process_id);
CREATE INDEX ix_episode_trial_id ON episode (trial_id);
CREATE INDEX ix_event_campaign_id ON event (campaign_id);
CREATE INDEX ix_event_episode_id ON event (episode_id);
CREATE UNIQUE INDEX uq_episode_active_trial_id ON episode (trial_id) WHERE state IN ('claimed', 'placed', 'running');
CREATE INDEX ix_study_entry_study_id ON study_entry (study_id);
CREATE INDEX ix_session_process_id ON session (process_id);
CREATE INDEX ix_episode_session_id ON episode (session_id);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('episode',0);
COMMIT;
