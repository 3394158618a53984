//! Text for pictures: escaping, formatting of numbers, and estimates of text widths without a font.

/// Escapes line feeds and the characters that are reserved in XML and HTML, and replaces tabs, carriage returns and the
/// characters that XML 1.0 forbids (control characters, section 2.2), so that any string is safe as element content and
/// as attribute value. Not real-time.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\n' => escaped.push_str("&#10;"),
            '\t' | '\r' => escaped.push(' '),
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

/// Formats `value` with a fixed number of decimals, a true minus sign, and thin spaces between groups of three digits
/// where the integer part has five or more (SI Brochure, section 5.4.4).
pub(super) fn decimal(value: f64, decimals: usize) -> String {
    let written = format!("{:.decimals$}", value.abs());
    let is_zero = written.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    let sign = if value < 0.0 && !is_zero { "\u{2212}" } else { "" };
    let (whole, fraction) = written.split_at(written.find('.').unwrap_or(written.len()));
    if whole.len() < 5 {
        return format!("{sign}{written}");
    }
    let mut grouped = sign.to_owned();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            grouped.push('\u{2009}');
        }
        grouped.push(digit);
    }
    grouped + fraction
}

/// Formats `value` with four significant digits, for running text.
pub(super) fn significant(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-3..1e5).contains(&magnitude) {
        return format!("{value:.3e}").replace('-', "\u{2212}");
    }
    let decimals = [1000.0, 100.0, 10.0, 1.0].iter().filter(|&&bound| magnitude < bound).count();
    let written = decimal(value, decimals);
    match written.contains('.') {
        true => written.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => written,
    }
}

/// Formats an exponent in superscript digits.
pub(super) fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |sign: char| sign.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    exponent.to_string().chars().map(raised).collect()
}

/// Returns an upper bound of the width of `text` at the font size `font_px`. The advance widths are those of a wide typeface
/// (DejaVu Sans), so that a text that fits with these widths fits in narrower system fonts as well.
pub(super) fn width_px(text: &str, font_px: f64) -> f64 {
    text.chars().map(advance_em).sum::<f64>() * font_px
}

fn advance_em(character: char) -> f64 {
    match character {
        'i' | 'j' | 'l' | '\'' | '|' | ' ' | '\u{2009}' | '.' | ',' | ':' | ';' | '·' => 0.33,
        'f' | 't' | 'r' | 'I' | '(' | ')' | '[' | ']' | '/' | '-' | '!' => 0.41,
        '⁰'..='₉' | '¹' | '²' | '³' => 0.41,
        'm' | 'w' | 'M' | 'W' | '@' | '%' | '…' | '—' => 0.98,
        '+' | '\u{2212}' | '=' | '<' | '>' | '×' | '±' | '≤' | '≥' => 0.84,
        'A'..='Z' | 'µ' | '_' | '&' => 0.74,
        // Han, kana, Hangul and full-width forms fill a square.
        '\u{1100}'..='\u{11ff}' | '\u{2e80}'..='\u{d7ff}' | '\u{f900}'..='\u{ffef}' => 1.0,
        '\u{10000}'.. => 1.2,
        _ => 0.63,
    }
}

/// Shortens `text` to the width `limit_px`, with an ellipsis at its end, if necessary.
pub(super) fn shorten(text: &str, limit_px: f64, font_px: f64) -> String {
    if width_px(text, font_px) <= limit_px {
        return text.to_owned();
    }
    let mut room_px = limit_px - width_px("…", font_px);
    let mut short = String::new();
    for character in text.chars() {
        room_px -= advance_em(character) * font_px;
        if room_px < 0.0 {
            break;
        }
        short.push(character);
    }
    short.truncate(short.trim_end().len());
    short.push('…');
    short
}

/// Breaks `text` at spaces into lines that fit `limit_px`; a single word that does not fit is shortened.
pub(super) fn wrap(text: &str, limit_px: f64, font_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line)
                if width_px(line, font_px) + width_px(" ", font_px) + width_px(word, font_px) <= limit_px =>
            {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(shorten(word, limit_px, font_px)),
        }
    }
    lines
}

/// Appends a coordinate rounded to a tenth of a pixel, in the fewest characters: `12.5`, `-.3`, `7`.
pub(super) fn push_tenths(out: &mut String, tenths: f64) {
    // Whole tenths divided by ten print with at most one decimal, exactly rounded.
    let written = (tenths / 10.0).to_string();
    match (written.strip_prefix("0."), written.strip_prefix("-0.")) {
        (Some(rest), _) => out.extend([".", rest]),
        (_, Some(rest)) => out.extend(["-.", rest]),
        _ => out.push_str(&written),
    }
}

/// Formats a length or coordinate in pixels, rounded to a tenth.
pub(super) fn px(value: f64) -> String {
    let mut out = String::new();
    // Adding zero turns -0 into 0.
    push_tenths(&mut out, (value * 10.0).round() + 0.0);
    out
}
