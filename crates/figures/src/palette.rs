//! Colours that colour-blind readers can distinguish on a white background (Okabe and Ito, 2008).

/// Opaque sRGB colour: red, green and blue from 0 to 255.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// Mixture of white with this colour, whose share is from 0 to 1.
    pub fn on_white(self, share: f64) -> Self {
        let mix = |white: u8, end: u8| (f64::from(white) + share * (f64::from(end) - f64::from(white))).round() as u8;
        Self(mix(WHITE.0, self.0), mix(WHITE.1, self.1), mix(WHITE.2, self.2))
    }
}

impl std::fmt::Display for Colour {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

/// Colour of text and data points.
pub const INK: Colour = Colour(0x1f, 0x23, 0x28);
/// Colour of axis lines and ticks.
pub const AXIS: Colour = Colour(0x4a, 0x50, 0x57);
/// Colour of secondary text.
pub const MUTED: Colour = Colour(0x6b, 0x72, 0x7a);
/// Colour of effects that an experiment cannot detect, paler than secondary text.
pub const PALE: Colour = Colour(0xb9, 0xc0, 0xc7);
/// Colour of grid lines.
pub const GRID: Colour = Colour(0xe4, 0xe7, 0xea);
/// Colour of the background.
pub const WHITE: Colour = Colour(0xff, 0xff, 0xff);
/// Colour of the first data series.
pub const BLUE: Colour = Colour(0x00, 0x72, 0xb2);
/// Colour of the second data series, and of reference values.
pub const VERMILLION: Colour = Colour(0xd5, 0x5e, 0x00);
/// Colour of the third data series.
pub const GREEN: Colour = Colour(0x00, 0x9e, 0x73);
/// Colour of the fourth data series.
pub const PURPLE: Colour = Colour(0xcc, 0x79, 0xa7);
/// Colour of the fifth data series.
pub const ORANGE: Colour = Colour(0xe6, 0x9f, 0x00);
/// Colour of the sixth data series.
pub const SKY: Colour = Colour(0x56, 0xb4, 0xe9);

const SERIES: [Colour; 6] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY];

/// Colour of the data series `index`, counted from 0. Colours repeat after six series.
pub fn series(index: usize) -> Colour {
    SERIES[index % SERIES.len()]
}
