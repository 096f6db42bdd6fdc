//! Figure of robots compared for one target: the force that each needs against its volume, with the Pareto front.

use super::axes::{Axes, AxisStyle, LABEL_SIZE_PX, TICK_SIZE_PX, title_with_text, widest_y_number_px};
use super::font::{shorten, text_width_px};
use super::palette::{BLUE, INK, MUTED, VERMILLION};
use super::svg::{Anchor, Rect, Stroke, Svg, TextStyle};
use super::ticks::AxisScale;
use documents::prediction::PlannedRobot;

const WIDTH_PX: f64 = 960.0;
const MARGIN_PX: f64 = 20.0;
const HEIGHT_PX: f64 = 420.0;
const FOOT_PX: f64 = 56.0;
const DOT_PX: f64 = 9.0;
/// Number of ticks of an axis.
const MOST_TICKS: usize = 8;

/// Draws the feasible robots of a plan. Names stand beside the robots on the front; infeasible robots are listed in the text.
pub fn robots(title: &str, sentence: &str, robots: &[PlannedRobot]) -> Svg {
    let feasible: Vec<&PlannedRobot> = robots.iter().filter(|robot| robot.feasible).collect();
    let too_weak: Vec<&str> = robots.iter().filter(|robot| !robot.feasible).map(|robot| robot.name.as_str()).collect();
    let words = match too_weak.as_slice() {
        [] => sentence.to_owned(),
        names => format!("{sentence} The force is too weak for: {}.", names.join("; ")),
    };
    let around = |values: &dyn Fn(&PlannedRobot) -> f64| {
        let positive = feasible.iter().map(|robot| values(robot)).filter(|value| *value > 0.0);
        let (lower, upper) = positive.fold((f64::INFINITY, 0.0_f64), |(l, u), value| (l.min(value), u.max(value)));
        if lower > upper { AxisScale::log10(1.0, 10.0) } else { AxisScale::log10(lower / 1.5, upper * 1.5) }
    };
    let (x, y) = (around(&|robot| robot.volume_mm3), around(&|robot| robot.force_un));
    let draw = |svg: &mut Svg| {
        let width = WIDTH_PX - 2.0 * MARGIN_PX;
        let top = MARGIN_PX + title_with_text(svg, title, &words, (MARGIN_PX, MARGIN_PX), width) + 16.0;
        let left = widest_y_number_px(&y, MOST_TICKS) + 48.0;
        let frame = Rect { x: left, y: top, width: WIDTH_PX - left - MARGIN_PX, height: HEIGHT_PX };
        let axes = Axes { frame, x, y };
        axes.x_axis(svg, AxisStyle::new(Some("robot's volume (mm³)"), MOST_TICKS, 36.0).grid());
        axes.y_axis(svg, AxisStyle::new(Some("force that is needed (µN)"), MOST_TICKS, left - 12.0).grid());
        axes.outline(svg);
        front(svg, &axes, &feasible);
        frame.bottom() + FOOT_PX
    };
    Svg::drawn(WIDTH_PX, title, 0.0, draw)
}

fn front(svg: &mut Svg, axes: &Axes, feasible: &[&PlannedRobot]) {
    let mut on_front: Vec<&&PlannedRobot> = feasible.iter().filter(|robot| robot.on_front).collect();
    on_front.sort_by(|a, b| a.volume_mm3.total_cmp(&b.volume_mm3));
    let (volumes, forces): (Vec<f64>, Vec<f64>) =
        on_front.iter().map(|robot| (robot.volume_mm3, robot.force_un)).unzip();
    axes.line(svg, &volumes, &forces, Stroke::solid(BLUE, 1.2).dashed(5.0, 4.0));
    for robot in feasible {
        let colour = match (robot.chosen, robot.on_front) {
            (true, _) => VERMILLION,
            (false, true) => BLUE,
            (false, false) => MUTED,
        };
        axes.scatter(svg, std::iter::once((robot.volume_mm3, robot.force_un)), colour, DOT_PX, 1.0);
    }
    for robot in feasible.iter().filter(|robot| robot.on_front || robot.chosen) {
        let at = axes.px(robot.volume_mm3, robot.force_un);
        let name = shorten(&robot.name, TICK_SIZE_PX, 0.4 * axes.frame.width);
        // A name that would cross the right edge stands on the left of its dot.
        let is_right = at.0 + DOT_PX + text_width_px(&name, TICK_SIZE_PX) < axes.frame.right();
        let (shift, anchor) = if is_right { (DOT_PX, Anchor::Start) } else { (-DOT_PX, Anchor::End) };
        svg.text(&name, (at.0 + shift, at.1 - 0.5 * LABEL_SIZE_PX), TextStyle::new(TICK_SIZE_PX, anchor).colour(INK));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_feasible_robot_has_a_dot_and_the_others_are_named() {
        let robot = |name: &str, volume_mm3: f64, force_un: f64, feasible: bool| PlannedRobot {
            name: name.into(),
            apparatus: String::new(),
            length_mm: 1.0,
            volume_mm3,
            largest_force_un: 20.0,
            feasible,
            force_un,
            probability: 0.95,
            reach_mm: 1.0,
            on_front: feasible,
            chosen: name == "small",
        };
        let all = [robot("small", 0.01, 3.0, true), robot("large", 0.1, 6.0, true), robot("huge", 10.0, 20.0, false)];
        let text = robots("title", "One sentence.", &all).document();
        assert!(text.contains("The force is too weak for: huge.") && text.contains(">large<"), "{text}");
        assert!(robots("title", "", &all[2..]).document().contains("too weak"));
    }
}
