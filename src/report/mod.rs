//! Figures and exchange formats.
