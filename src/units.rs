//! Unit suffixes, parsed once at the border; everything inside is SI.
