"""The tables of a campaign; units stand in the names of the columns."""

from typing import Final

SCHEMA_VERSION: Final = 2

TABLES: Final = """
CREATE TABLE campaign (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    name TEXT NOT NULL, procedure TEXT NOT NULL, sample TEXT NOT NULL,
    recipe_text TEXT NOT NULL, recipe_sha256 TEXT NOT NULL, started TEXT NOT NULL,
    description TEXT NOT NULL, operator TEXT NOT NULL, hardware TEXT NOT NULL,
    seed INTEGER NOT NULL, rate REAL NOT NULL, versions_json TEXT NOT NULL,
    ended TEXT NOT NULL DEFAULT '', end_reason TEXT NOT NULL DEFAULT ''
);
CREATE TABLE run (
    number INTEGER PRIMARY KEY, started TEXT NOT NULL, versions_json TEXT NOT NULL,
    begin_s REAL NOT NULL, end_s REAL
);
CREATE TABLE calibration (
    name TEXT NOT NULL, residual REAL, unit TEXT NOT NULL, made TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES run
);
CREATE TABLE fibre (
    number INTEGER PRIMARY KEY, run INTEGER NOT NULL REFERENCES run, outcome TEXT NOT NULL,
    began_s REAL NOT NULL, ended_s REAL,
    found_x_plate_um REAL, found_y_plate_um REAL, found_angle_deg REAL,
    left_x_plate_um REAL, left_y_plate_um REAL, left_angle_deg REAL,
    length_um REAL, length_std_um REAL, width_um REAL, width_std_um REAL,
    curl REAL, curl_std REAL,
    cause TEXT NOT NULL DEFAULT '', text TEXT NOT NULL DEFAULT '',
    attempts INTEGER, peak_force_un REAL,
    ei_n_m2 REAL, ei_low_n_m2 REAL, ei_high_n_m2 REAL,
    clamp_offset_um REAL, clamp_offset_std_um REAL, chi2 REAL, freedom INTEGER,
    trusted INTEGER, flags TEXT NOT NULL DEFAULT '', reasons TEXT NOT NULL DEFAULT '',
    used_spans TEXT NOT NULL DEFAULT '', file TEXT NOT NULL DEFAULT ''
);
CREATE TABLE span (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL,
    place_um REAL, k_un_um REAL, k_std_un_um REAL, k_loading_un_um REAL, k_unloading_un_um REAL,
    hinge_um REAL, hinge_back_um REAL, baseline_un REAL, drift_un_s REAL,
    hysteresis_percent REAL, peak_un REAL, chi2 REAL, freedom INTEGER,
    flags TEXT NOT NULL DEFAULT '', PRIMARY KEY (fibre, number)
);
CREATE TABLE picture (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL, name TEXT NOT NULL,
    file TEXT NOT NULL, sha256 TEXT NOT NULL, taken_s REAL NOT NULL,
    scale_um_px REAL, zoom REAL, focus_um REAL, light_percent REAL,
    region_left_px INTEGER, region_top_px INTEGER,
    region_width_px INTEGER, region_height_px INTEGER,
    PRIMARY KEY (fibre, number)
);
CREATE TABLE operation (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL, name TEXT NOT NULL,
    began_s REAL NOT NULL, ended_s REAL NOT NULL, attempt INTEGER NOT NULL,
    cause TEXT NOT NULL, text TEXT NOT NULL, PRIMARY KEY (fibre, number)
);
CREATE TABLE journal (
    number INTEGER PRIMARY KEY, fibre INTEGER, time_s REAL NOT NULL, operation TEXT NOT NULL,
    phase TEXT NOT NULL, payload_json TEXT NOT NULL
);
"""
