//! Springs, dashpots and their creep compliance (physics §2).
