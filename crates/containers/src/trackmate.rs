//! Tracks of TrackMate: the exported tracks (`Tracks`) and the whole file (`TrackMate`), both XML.

use std::collections::{HashMap, HashSet};

use quick_xml::events::{BytesStart, Event};

use crate::table_text::{TableText, number};

pub fn recognises(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(4096)];
    let has = |word: &[u8]| start.windows(word.len()).any(|window| window == word);
    start.trim_ascii_start().starts_with(b"<") && (has(b"<Tracks") || has(b"<TrackMate"))
}

/// Position of a bead at one time: time, x, y and z.
type Spot = [f64; 4];

pub fn read(bytes: &[u8]) -> Result<TableText, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not valid UTF-8")?;
    let mut reader = quick_xml::Reader::from_str(text);
    let (mut space, mut time, mut interval) = ("um".to_string(), "s".to_string(), 1.0);
    // Spots by number, and tracks by name with their spots. In an exported file, spots stand in their tracks.
    let mut spots: HashMap<String, Spot> = HashMap::new();
    let mut tracks: Vec<(String, Vec<Spot>)> = Vec::new();
    let mut in_track = HashSet::new();
    loop {
        let event = reader.read_event().map_err(|error| error.to_string())?;
        let (Event::Start(element) | Event::Empty(element)) = event else {
            if matches!(event, Event::Eof) {
                break;
            }
            continue;
        };
        match element.local_name().as_ref() {
            "Tracks" => {
                space = attribute(&element, "spaceUnits").unwrap_or(space);
                time = attribute(&element, "timeUnits").unwrap_or(time);
                interval = of_number(&element, "frameInterval").unwrap_or(1.0);
            }
            "Model" => {
                space = attribute(&element, "spatialunits").unwrap_or(space);
                time = attribute(&element, "timeunits").unwrap_or(time);
            }
            "particle" => tracks.push((tracks.len().to_string(), Vec::new())),
            "detection" => {
                let spot = [("t", interval), ("x", 1.0), ("y", 1.0), ("z", 1.0)]
                    .map(|(name, scale)| of_number(&element, name).map_or(f64::NAN, |value| scale * value));
                tracks.last_mut().ok_or("a detection stands outside of a track")?.1.push(spot);
            }
            "Spot" => {
                let spot = ["POSITION_T", "POSITION_X", "POSITION_Y", "POSITION_Z"]
                    .map(|name| of_number(&element, name).unwrap_or(f64::NAN));
                spots.insert(attribute(&element, "ID").ok_or("a spot has no number")?, spot);
            }
            "Track" => {
                tracks.push((attribute(&element, "TRACK_ID").unwrap_or_else(|| tracks.len().to_string()), Vec::new()));
                in_track.clear();
            }
            "Edge" => {
                let track = &mut tracks.last_mut().ok_or("an edge stands outside of a track")?.1;
                for end in ["SPOT_SOURCE_ID", "SPOT_TARGET_ID"] {
                    let spot = attribute(&element, end).ok_or("an edge has no spot")?;
                    let place = *spots.get(&spot).ok_or_else(|| format!("spot {spot} is missing"))?;
                    if in_track.insert(spot) {
                        track.push(place);
                    }
                }
            }
            _ => {}
        }
    }
    tracks.retain(|(_, spots)| !spots.is_empty());
    let mut table = TableText::default();
    if tracks.is_empty() {
        return Ok(table);
    }
    let [space, time] = [spelt(&space), spelt(&time)];
    let has_depth = tracks.iter().flat_map(|(_, spots)| spots).any(|spot| spot[3] != 0.0 && spot[3].is_finite());
    table.title("tracks");
    let n = if has_depth { 4 } else { 3 };
    let columns = [format!("time [{time}]"), format!("x [{space}]"), format!("y [{space}]"), format!("z [{space}]")];
    table.row(std::iter::once("track".into()).chain(columns.into_iter().take(n)));
    for (name, mut spots) in tracks {
        spots.sort_by(|a, b| a[0].total_cmp(&b[0]));
        for spot in spots {
            table.row(std::iter::once(name.clone()).chain(spot[..n].iter().copied().map(number)));
        }
    }
    Ok(table)
}

/// Unit as a table's header spells it.
fn spelt(unit: &str) -> String {
    match unit {
        "micron" | "microns" | "micrometer" | "micrometre" => "um".into(),
        "sec" | "second" | "seconds" => "s".into(),
        other => other.to_string(),
    }
}

fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let found = element.try_get_attribute(name).ok()??;
    Some(found.value.into_owned())
}

fn of_number(element: &BytesStart<'_>, name: &str) -> Option<f64> {
    attribute(element, name)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exported_tracks_become_rows_with_times() {
        let xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Tracks nTracks=\"2\" spaceUnits=\"micron\" frameInterval=\"0.5\" timeUnits=\"sec\">\
            <particle nSpots=\"2\"><detection t=\"0\" x=\"1.5\" y=\"2\" z=\"0\"/><detection t=\"2\" x=\"3\" y=\"4\" z=\"0\"/></particle>\
            <particle nSpots=\"1\"><detection t=\"1\" x=\"5\" y=\"6\" z=\"0\"/></particle></Tracks>";
        assert!(recognises(xml.as_bytes()));
        assert_eq!(
            read(xml.as_bytes()).unwrap().text,
            "tracks\ntrack\ttime [s]\tx [um]\ty [um]\n0\t0\t1.5\t2\n0\t1\t3\t4\n1\t0.5\t5\t6\n"
        );
    }

    #[test]
    fn edges_of_a_whole_file_collect_the_spots_of_a_track() {
        let spot = |id: u8, t: u8| {
            format!("<Spot ID=\"{id}\" POSITION_T=\"{t}\" POSITION_X=\"{id}\" POSITION_Y=\"0\" POSITION_Z=\"1\"/>")
        };
        let edge = |from: u8, to: u8| format!("<Edge SPOT_SOURCE_ID=\"{from}\" SPOT_TARGET_ID=\"{to}\"/>");
        let xml = format!(
            "<TrackMate version=\"7\"><Model spatialunits=\"um\" timeunits=\"s\"><AllSpots>{}{}{}</AllSpots><AllTracks><Track TRACK_ID=\"4\">{}{}</Track></AllTracks></Model></TrackMate>",
            spot(7, 1),
            spot(8, 0),
            spot(9, 2),
            edge(8, 7),
            edge(7, 9)
        );
        assert_eq!(
            read(xml.as_bytes()).unwrap().text,
            "tracks\ntrack\ttime [s]\tx [um]\ty [um]\tz [um]\n4\t0\t8\t0\t1\n4\t1\t7\t0\t1\n4\t2\t9\t0\t1\n"
        );
    }
}
