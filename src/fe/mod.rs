//! Full-order finite elements (physics §3).
