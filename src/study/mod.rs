//! The study directory: revisions, provenance, atomic writes (contracts §3).
