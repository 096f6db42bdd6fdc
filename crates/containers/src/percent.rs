//! Cells of an Excel workbook that are shown in percent: the cell holds 0.15 where the sheet shows 15 %.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Cursor, Read};

use quick_xml::events::{BytesStart, Event};

/// Built-in formats of percent (ECMA-376, part 1, 18.8.30).
const BUILT_IN: [u32; 2] = [9, 10];

/// References, such as `B7`, of the cells whose format has a percent sign, by sheet. Sheets without such cells, and workbooks that cannot be read, have no entry.
pub fn percent_cells(bytes: &[u8]) -> BTreeMap<String, BTreeSet<String>> {
    let part = |name: &str| {
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).ok()?;
        let mut text = String::new();
        archive.by_name(name).ok()?.read_to_string(&mut text).ok()?;
        Some(text)
    };
    let Some(styles) = part("xl/styles.xml").map(|text| percent_styles(&text)).filter(|styles| !styles.is_empty())
    else {
        return BTreeMap::new();
    };
    let mut targets = BTreeMap::new();
    elements(&part("xl/_rels/workbook.xml.rels").unwrap_or_default(), |element, _| {
        if let (Some(id), Some(target)) = (attribute(element, "Id"), attribute(element, "Target")) {
            targets.insert(id, target);
        }
    });
    let mut found = BTreeMap::new();
    elements(&part("xl/workbook.xml").unwrap_or_default(), |element, _| {
        if element.local_name().as_ref() != "sheet" {
            return;
        }
        let target = attribute(element, "r:id").and_then(|id| targets.get(&id));
        let (Some(name), Some(target)) = (attribute(element, "name"), target) else { return };
        let path = match target.strip_prefix('/') {
            Some(path) => path.to_string(),
            None => format!("xl/{target}"),
        };
        let mut cells = BTreeSet::new();
        elements(&part(&path).unwrap_or_default(), |cell, _| {
            let style = || attribute(cell, "s")?.parse().ok();
            if cell.local_name().as_ref() == "c" && style().is_some_and(|style| styles.contains(&style)) {
                cells.extend(attribute(cell, "r"));
            }
        });
        if !cells.is_empty() {
            found.insert(name, cells);
        }
    });
    found
}

/// Numbers of the cell styles whose format has a percent sign.
fn percent_styles(text: &str) -> BTreeSet<usize> {
    let (mut formats, mut styles, mut number) = (BTreeSet::from(BUILT_IN), BTreeSet::new(), 0);
    elements(text, |element, parent| {
        let id = attribute(element, "numFmtId").and_then(|id| id.parse::<u32>().ok());
        match element.local_name().as_ref() {
            "numFmt" => {
                // A percent sign between quotation marks or behind a backslash is text. Behind `_` and `*` it is a blank or a fill character.
                let code = ["\\%", "_%", "*%"]
                    .iter()
                    .fold(attribute(element, "formatCode").unwrap_or_default(), |code, text| code.replace(text, ""));
                if code.split('"').step_by(2).any(|part| part.contains('%')) {
                    formats.extend(id);
                }
            }
            "xf" if parent == "cellXfs" => {
                if id.is_some_and(|id| formats.contains(&id)) {
                    styles.insert(number);
                }
                number += 1;
            }
            _ => {}
        }
    });
    styles
}

/// Shows every element to a function, with the name of the element around it, up to the first error.
fn elements(text: &str, mut see: impl FnMut(&BytesStart<'_>, &str)) {
    let mut reader = quick_xml::Reader::from_str(text);
    let mut around: Vec<String> = Vec::new();
    loop {
        match reader.read_event() {
            Ok(Event::Start(element)) => {
                see(&element, around.last().map_or("", String::as_str));
                around.push(element.local_name().as_ref().to_string());
            }
            Ok(Event::Empty(element)) => see(&element, around.last().map_or("", String::as_str)),
            Ok(Event::End(_)) => drop(around.pop()),
            Ok(Event::Eof) | Err(_) => return,
            Ok(_) => {}
        }
    }
}

/// Value of an attribute, with its escapes resolved.
fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let value = element.try_get_attribute(name).ok()??.value.into_owned();
    quick_xml::escape::unescape(&value).ok().map(|text| text.into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn styles_of_percent_are_those_of_their_formats() {
        let text = r#"<styleSheet><numFmts count="4"><numFmt numFmtId="167" formatCode="0.00_%"/><numFmt numFmtId="164" formatCode="0.000%"/><numFmt numFmtId="165" formatCode="0.0&quot;%&quot;"/>
            <numFmt numFmtId="166" formatCode="0\%"/></numFmts><cellStyleXfs><xf numFmtId="10"/></cellStyleXfs>
            <cellXfs><xf numFmtId="0"/><xf numFmtId="10"/><xf numFmtId="164"><alignment/></xf><xf numFmtId="165"/><xf numFmtId="9"/><xf numFmtId="166"/><xf numFmtId="167"/></cellXfs></styleSheet>"#;
        assert_eq!(percent_styles(text), BTreeSet::from([1, 2, 4]));
        assert!(percent_styles("<styleSheet><cellXfs><xf").is_empty());
    }
}
