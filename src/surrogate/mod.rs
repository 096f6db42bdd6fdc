//! Snapshots, POD and Galerkin projection (physics §3.3).
