//! Jobs of the library, from an experiment to a result.

mod actuation;
mod begins;
mod cohort_data;
mod contradictions;
mod devices;
mod draw_tables;
mod drives;
mod experiment_reading;
mod experiment_rejections;
mod groups;
mod groups_walk;
mod indentation;
mod laboratory_tables;
mod main_job;
mod schemas;
mod table_kinds;
