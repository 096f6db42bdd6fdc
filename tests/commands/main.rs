//! User tests of the commands and the examples.

#[path = "../closed_forms/mod.rs"]
mod closed_forms;
mod cohort;
mod compare;
mod design;
mod diagnose;
mod effects_extend;
mod examples;
mod fit_simulate_corner;
mod groups;
mod hard_input;
mod http;
mod indentation;
mod ladder;
mod laws;
mod learn;
mod links;
#[path = "../mutators/mod.rs"]
mod mutators;
mod numbers;
mod oscillation;
mod outside;
mod predict;
#[path = "../program/mod.rs"]
mod program;
mod relaxation;
mod report;
mod sample;
mod serve;
mod shape_study;
mod shapes;
mod shell;
mod slow_clients;
mod tasks;
mod tasks_commands;
mod tasks_models;
mod trust;
mod workbench;
