//! Figure of a cohort's diagnosis: a map with a row for each record and a column for each effect. The colour shows the record's gain by the effect, whose sizes
//! share one distribution. The sums over all records are below.

use super::axes::{TICK_SIZE_PX, title_with_text};
use super::font::{shorten, text_width_px};
use super::legend::{FULL_COLOUR, signed_colour, signed_colour_bar};
use super::number::{format_decimals, format_significant};
use super::palette::{Colour, GREEN, INK, MUTED, ORANGE, SKY, WHITE};
use super::svg::{Anchor, Fill, Point, Rect, Stroke, Style, Svg, TextStyle};
use base::Result;
use documents::cohort::{CohortDiagnosis, CohortEffect, CohortSpecimen};
use documents::diagnosis::Status;

const MARGIN_PX: f64 = 20.0;
const WIDTH_PX: f64 = 1080.0;
/// Maximum width of a record's label, in pixels.
const LABEL_PX: f64 = 190.0;
/// Width of the colour bar with its numbers, in pixels.
const RIGHT_PX: f64 = 96.0;
/// Gain (nats) above which the number is written into the cell.
const WRITTEN_NATS: f64 = 1.0;
/// Largest number of records for which rows are high, and the height of such a row in pixels.
const FEW: (usize, f64) = (30, 22.0);
const MANY: (usize, f64) = (90, 14.0);
const CROWD_PX: f64 = 4.0;
const GAP_PX: f64 = 8.0;
const SUM_PX: f64 = 22.0;

/// Draws the figure of a cohort's diagnosis.
///
/// # Errors
/// None at present; future versions may refuse inconsistent documents.
pub fn cohort(diagnosis: &CohortDiagnosis) -> Result<Svg> {
    let heading = format!("{} records: which effects do they lack?", diagnosis.specimens.len());
    let draw = |svg: &mut Svg| {
        let width = WIDTH_PX - 2.0 * MARGIN_PX;
        let below = title_with_text(svg, &heading, &diagnosis.verdict.sentence, (MARGIN_PX, MARGIN_PX), width);
        Map::of(diagnosis).draw(svg, MARGIN_PX + below + 10.0)
    };
    Ok(Svg::drawn(WIDTH_PX, &heading, MARGIN_PX, draw))
}

struct Map<'a> {
    /// Effects in order of decreasing gain.
    effects: Vec<&'a CohortEffect>,
    /// Records in order of their groups.
    records: Vec<&'a CohortSpecimen>,
    row_px: f64,
}

impl<'a> Map<'a> {
    fn of(diagnosis: &'a CohortDiagnosis) -> Self {
        let is_looked_for =
            |cohort_effect: &&CohortEffect| cohort_effect.refused.is_none() && cohort_effect.parameter.is_some();
        let mut effects: Vec<&CohortEffect> = diagnosis.effects.iter().filter(is_looked_for).collect();
        let is_named =
            |cohort_effect: &CohortEffect| matches!(cohort_effect.status, Status::Claimed | Status::Equivalent);
        effects.sort_by(|a, b| is_named(b).cmp(&is_named(a)).then(b.gain_nats.total_cmp(&a.gain_nats)));
        let mut records: Vec<&CohortSpecimen> = diagnosis.specimens.iter().collect();
        records.sort_by(|a, b| a.group.cmp(&b.group));
        let n = records.len();
        let row_px = match n {
            _ if n <= FEW.0 => FEW.1,
            _ if n <= MANY.0 => MANY.1,
            _ => CROWD_PX,
        };
        Self { effects, records, row_px }
    }

    fn is_named(&self) -> bool {
        self.row_px > CROWD_PX
    }

    /// Draws the map with its upper edge at `top`, and returns the position of its lower edge.
    fn draw(&self, svg: &mut Svg, top: f64) -> f64 {
        let header =
            self.effects.iter().map(|effect| text_width_px(&effect.effect, TICK_SIZE_PX)).fold(40.0, f64::max) + 10.0;
        let n_groups = self.records.chunk_by(|a, b| a.group == b.group).count();
        let height = self.row_px * self.records.len() as f64 + GAP_PX * n_groups.saturating_sub(1) as f64;
        let left = MARGIN_PX + LABEL_PX;
        let frame = Rect { x: left, y: top + header, width: WIDTH_PX - left - RIGHT_PX - MARGIN_PX, height };
        let column = frame.width / self.effects.len().max(1) as f64;
        for (k, effect) in self.effects.iter().enumerate() {
            let at = (frame.x + (k as f64 + 0.5) * column + 0.36 * TICK_SIZE_PX, frame.y - 6.0);
            svg.text(&effect.effect, at, TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(ink(effect)).upwards());
        }
        let mut y = frame.y;
        for group in self.records.chunk_by(|a, b| a.group == b.group) {
            for record in group {
                self.draw_row(svg, record, Rect { y, height: self.row_px, ..frame }, column);
                y += self.row_px;
            }
            let rows =
                Rect { y: y - self.row_px * group.len() as f64, height: self.row_px * group.len() as f64, ..frame };
            if !self.is_named() {
                let name = group[0].group.clone().unwrap_or_else(|| format!("{} records", group.len()));
                let at = (frame.x - 8.0, rows.y + 0.5 * rows.height + 0.36 * TICK_SIZE_PX);
                svg.text(&shorten(&name, TICK_SIZE_PX, LABEL_PX - 8.0), at, TextStyle::new(TICK_SIZE_PX, Anchor::End));
            }
            svg.rect(rows, Style::from(Stroke::solid(MUTED, 0.8)));
            y += GAP_PX;
        }
        let bar = signed_colour_bar(svg, &frame);
        for (dy, text) in [(-22.0, "nats that a"), (-8.0, "record gains")] {
            let at = (bar.frame.x - 6.0, bar.frame.y + dy);
            svg.text(text, at, TextStyle::new(TICK_SIZE_PX, Anchor::Start));
        }
        bar.outline(svg);
        self.sums(svg, frame, column)
    }

    fn draw_row(&self, svg: &mut Svg, record: &CohortSpecimen, strip: Rect, column: f64) {
        let middle = strip.y + 0.5 * strip.height + 0.36 * TICK_SIZE_PX;
        if self.is_named() {
            let mark = if record.leaves_too_much { " !" } else { "" };
            let label = shorten(&format!("{}{mark}", record.experiment), TICK_SIZE_PX, LABEL_PX - 8.0);
            svg.text(&label, (strip.x - 8.0, middle), TextStyle::new(TICK_SIZE_PX, Anchor::End));
        }
        for (k, effect) in self.effects.iter().enumerate() {
            let area = Rect { x: strip.x + k as f64 * column, width: column, ..strip };
            let Some(gain) = record.gains.iter().find(|gain| gain.effect == effect.effect) else {
                svg.rect(area, Fill::new(MUTED, 0.12));
                continue;
            };
            let line = if self.is_named() { Some(Stroke::solid(WHITE, 0.8)) } else { None };
            svg.rect(area, Style { fill: Some(Fill::new(signed_colour(gain.gain_nats), 1.0)), stroke: line });
            let text = format_significant(gain.gain_nats, 2);
            let fits = text_width_px(&text, TICK_SIZE_PX) < column - 4.0 && strip.height >= FEW.1;
            if gain.gain_nats.abs() > WRITTEN_NATS && fits {
                let ink = if gain.gain_nats.abs() > 0.6 * FULL_COLOUR { WHITE } else { INK };
                let style = TextStyle::new(TICK_SIZE_PX, Anchor::Middle).colour(ink);
                svg.text(&text, (area.x + 0.5 * column, middle), style);
            }
        }
    }

    /// Writes the sums below the map: gain of all records, gain on held-out cycles, and p. Returns the position of their lower edge.
    fn sums(&self, svg: &mut Svg, frame: Rect, column: f64) -> f64 {
        type Text<'a> = &'a dyn Fn(&CohortEffect) -> String;
        let rows: [(&str, Text); 3] = [
            ("all records (nats)", &|cohort_effect| rounded(cohort_effect.gain_nats)),
            ("held-out cycles (nats)", &|cohort_effect| cohort_effect.heldout_gain_nats.map_or("–".into(), rounded)),
            ("p of the search", &|cohort_effect| short_p(cohort_effect.p_familywise)),
        ];
        let mut y = frame.bottom() + 10.0;
        for (name, of) in rows {
            y += SUM_PX;
            let at: Point = (frame.x - 8.0, y);
            svg.text(name, at, TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(MUTED));
            for (k, effect) in self.effects.iter().enumerate() {
                let text = shorten(&of(effect), TICK_SIZE_PX, column - 2.0);
                let style = TextStyle::new(TICK_SIZE_PX, Anchor::Middle).colour(ink(effect));
                svg.text(&text, (frame.x + (k as f64 + 0.5) * column, y), style);
            }
        }
        let words = "green: claimed; blue: equivalent; orange: suggestive; !: residuals larger than noise";
        svg.text(words, (frame.x, y + SUM_PX), TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(MUTED));
        y + SUM_PX + 6.0
    }
}

fn rounded(gain_nats: f64) -> String {
    format_decimals(gain_nats, usize::from(gain_nats.abs() < 10.0))
}

fn short_p(p: f64) -> String {
    if p >= 0.1 { format_decimals(p, 1) } else { format_decimals(p, 3).replacen("0.", ".", 1) }
}

fn ink(effect: &CohortEffect) -> Colour {
    match effect.status {
        Status::Claimed => GREEN,
        Status::Equivalent => SKY,
        Status::Suggestive => ORANGE,
        Status::Unsupported => INK,
        Status::Invisible => MUTED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout_tests::{LONG, assert_legible};
    use documents::cohort::{CohortErrors, CohortGain, CohortSimulations, CohortVerdict};
    use documents::diagnosis::VerdictKind;

    fn diagnosis(n_records: usize) -> CohortDiagnosis {
        let slugs = models::effects::EFFECTS.iter().map(|effect| effect.slug());
        let effect = |(k, slug): (usize, &str)| CohortEffect {
            effect: slug.into(),
            parameter: Some("x".into()),
            status: [Status::Claimed, Status::Equivalent, Status::Suggestive, Status::Unsupported][k.min(3)],
            gain_nats: 1234.5 / (k * k + 1) as f64,
            p_familywise: 0.000_5 * (k + 1) as f64,
            heldout_gain_nats: Some(-0.3 + 12.0 / (k + 1) as f64),
            law: None,
            records: n_records,
            refused: None,
        };
        let gain = |record: usize, k: usize, slug: &str| CohortGain {
            effect: slug.into(),
            gain_nats: ((record * 7 + k * 3) % 13) as f64 - 5.5,
            own_gain_nats: 1.0,
        };
        let specimen = |record: usize| CohortSpecimen {
            id: format!("eye {record}"),
            experiment: if record == 1 { LONG.into() } else { format!("eye-{record}-central") },
            group: Some(["bovine", "human"][record % 2].into()),
            gains: slugs.clone().enumerate().map(|(k, slug)| gain(record, k, slug)).collect(),
            probability: None,
            value: None,
            leaves_too_much: record.is_multiple_of(5),
            outliers: 0,
        };
        CohortDiagnosis {
            verdict: CohortVerdict {
                kind: VerdictKind::Missing,
                effects: vec!["interface-slip".into()],
                equivalent: Vec::new(),
                sentence: format!("interface-slip is missing: {LONG}"),
            },
            effects: slugs.clone().enumerate().map(effect).collect(),
            specimens: (0..n_records).map(specimen).collect(),
            by: vec!["species".into()],
            margin: 0.2,
            groups: Vec::new(),
            contrasts: Vec::new(),
            law: Vec::new(),
            base: CohortErrors { rmse_heldout_um: Some(4.0) },
            extended: None,
            simulations: CohortSimulations { of_each_record: 99, cohorts: 1999, threshold_nats: Some(6.0) },
            remarks: Vec::new(),
        }
    }

    /// Figures of cohorts with 2, 20, 60 and 300 records are legible.
    #[test]
    fn cohorts_of_any_size_are_legible() {
        for n_records in [2, 20, 60, 300] {
            assert_legible(&format!("{n_records} records"), &cohort(&diagnosis(n_records)).expect("drawn"));
        }
    }
}
