//! Text in encodings of single languages, such as windows-1251 or Shift_JIS, which is converted to UTF-8.

use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{Encoding, WINDOWS_1252};

/// Bytes of °, ±, ², ³ and µ in Latin-1.
const SIGNS: [u8; 5] = [0xb0, 0xb1, 0xb2, 0xb3, 0xb5];

/// Name of a text's encoding and the text in UTF-8. `None` for UTF-8, UTF-16 and Latin-1, which tables may keep, and for bytes that are no text.
pub fn convert(bytes: &[u8]) -> Option<(&'static str, String)> {
    // Signs of units are no sign of a language.
    let is_sign = |byte: &u8| byte.is_ascii() || SIGNS.contains(byte);
    if bytes.iter().all(is_sign)
        || bytes.contains(&0)
        || std::str::from_utf8(bytes).is_ok()
        || Encoding::for_bom(bytes).is_some()
    {
        return None;
    }
    let mut detector = EncodingDetector::new(Iso2022JpDetection::Deny);
    detector.feed(bytes, true);
    let encoding = detector.guess(None, Utf8Detection::Deny);
    // Latin-1 has the letters of western languages at the same places.
    let (text, _, has_errors) = encoding.decode(bytes);
    (encoding != WINDOWS_1252 && !has_errors).then(|| (encoding.name(), text.into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn russian_and_japanese_texts_are_converted_and_western_ones_stay() {
        for (label, text) in [
            ("windows-1251", "Время (с);Сила (мкН);Перемещение (мкм)\n0,00;4,60;0,12\n"),
            ("Shift_JIS", "試験名: クリープ試験\n時間 [s],力 [uN],変位 [um]\n0.00,4.60,0.12\n"),
            ("GBK", "时间(s),力(uN),位移(um)\n0.00,4.60,0.12\n"),
        ] {
            let bytes = Encoding::for_label(label.as_bytes()).unwrap().encode(text).0;
            assert_eq!(convert(&bytes).map(|(_, text)| text).as_deref(), Some(text), "{label}");
        }
        for bytes in [
            &b"Zeit (s);Kraft (\xb5N);L\xe4nge (\xb5m)\n0,0;1,0;2,0\n"[..],
            "µm".as_bytes(),
            b"\xff\xfe1\0,\0",
            b"\xb5\0",
        ] {
            assert_eq!(convert(bytes), None, "{bytes:?}");
        }
    }
}
