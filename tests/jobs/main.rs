//! Jobs of the library, from an experiment to a result.

mod cohort_data;
mod experiment_rejections;
mod groups;
mod groups_walk;
mod indentation;
mod laboratory_tables;
mod main_job;
