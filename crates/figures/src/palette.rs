//! Colours that colour-blind readers can distinguish (Okabe and Ito, 2008) on a white background.

/// Opaque sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl std::fmt::Display for Colour {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

/// Text and data points.
pub const INK: Colour = Colour(0x1f, 0x23, 0x28);
/// Axis lines and ticks.
pub const AXIS: Colour = Colour(0x4a, 0x50, 0x57);
/// Secondary text.
pub const MUTED: Colour = Colour(0x6b, 0x72, 0x7a);
/// Grid lines.
pub const GRID: Colour = Colour(0xe4, 0xe7, 0xea);
/// Background.
pub const WHITE: Colour = Colour(0xff, 0xff, 0xff);
/// First series.
pub const BLUE: Colour = Colour(0x00, 0x72, 0xb2);
/// Second series; reference values.
pub const VERMILLION: Colour = Colour(0xd5, 0x5e, 0x00);
/// Third series.
pub const GREEN: Colour = Colour(0x00, 0x9e, 0x73);
/// Fourth series.
pub const PURPLE: Colour = Colour(0xcc, 0x79, 0xa7);
/// Fifth series.
pub const ORANGE: Colour = Colour(0xe6, 0x9f, 0x00);
/// Sixth series.
pub const SKY: Colour = Colour(0x56, 0xb4, 0xe9);

const SERIES: [Colour; 6] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY];

/// Colour of series `index`, counted from 0; repeats after six.
pub fn series(index: usize) -> Colour {
    SERIES[index % SERIES.len()]
}
