//! Plots of a few lines over the depth of the octree, as SVG.

/// A line: its name and its points.
pub(crate) type Line = (String, Vec<(f64, f64)>);

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 360.0;
/// Left, top, right, bottom.
const MARGIN: [f64; 4] = [70.0, 40.0, 190.0, 45.0];
const COLOURS: [&str; 6] = ["#0b6e4f", "#c1292e", "#235789", "#b8860b", "#7b4f9d", "#555555"];

/// A plot with a logarithmic axis upward and whole numbers to the right.
pub(crate) fn plot(title: &str, right: &str, up: &str, lines: &[Line]) -> String {
    let points = || lines.iter().flat_map(|(_, points)| points.iter().copied());
    let bounds = |f: fn((f64, f64)) -> f64| {
        points().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c), b.max(c)))
    };
    let (x, y) = (bounds(|p| p.0), bounds(|p| p.1));
    let decades = (y.0.log10().floor(), y.1.log10().ceil().max(y.0.log10().floor() + 1.0));
    let [left, top, far, bottom] = MARGIN;
    let at_x = |value: f64| left + (value - x.0) / (x.1 - x.0).max(1.0) * (WIDTH - left - far);
    let at_y = |value: f64| {
        let part = (value.log10() - decades.0) / (decades.1 - decades.0);
        HEIGHT - bottom - part * (HEIGHT - top - bottom)
    };
    let mut svg = String::new();
    let mut line = |text: String| {
        svg += &text;
        svg.push('\n');
    };
    line(format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13">"#
    ));
    line(format!(r#"<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>"#));
    line(format!(r#"<text x="{left}" y="24" font-size="15">{title}</text>"#));
    let (base, end) = (HEIGHT - bottom, WIDTH - far);
    for decade in decades.0 as i32..=decades.1 as i32 {
        let height = at_y(10f64.powi(decade));
        line(format!(r##"<path d="M{left} {height:.1}H{end}" stroke="#ddd"/>"##));
        let label =
            if (0..5).contains(&decade) { format!("{}", 10i32.pow(decade as u32)) } else { format!("1e{decade}") };
        line(format!(r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#, left - 6.0, height + 4.0));
    }
    for depth in x.0 as i32..=x.1 as i32 {
        let place = at_x(f64::from(depth));
        line(format!(r#"<text x="{place:.1}" y="{:.1}" text-anchor="middle">{depth}</text>"#, base + 18.0));
    }
    line(format!(
        r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{right}</text>"#,
        f64::midpoint(left, end),
        base + 36.0
    ));
    let middle = f64::midpoint(top, base);
    line(format!(
        r#"<text x="16" y="{middle:.1}" text-anchor="middle" transform="rotate(-90 16 {middle:.1})">{up}</text>"#
    ));
    let mut labels: Vec<(f64, usize)> = Vec::new();
    for (i, (_, points)) in lines.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let path: Vec<String> = points.iter().map(|&(a, b)| format!("{:.1} {:.1}", at_x(a), at_y(b))).collect();
        line(format!(r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="2"/>"#, path.join(" ")));
        for &(a, b) in points {
            line(format!(r#"<circle cx="{:.1}" cy="{:.1}" r="3" fill="{colour}"/>"#, at_x(a), at_y(b)));
        }
        labels.extend(points.last().map(|&(_, b)| (at_y(b), i)));
    }
    // Names beside the ends of lines, moved apart.
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut lowest = f64::NEG_INFINITY;
    for (height, i) in labels {
        lowest = height.max(lowest + 16.0);
        let (name, colour) = (&lines[i].0, COLOURS[i % COLOURS.len()]);
        line(format!(r#"<text x="{:.1}" y="{:.1}" fill="{colour}">{name}</text>"#, end + 10.0, lowest + 4.0));
    }
    line("</svg>".to_owned());
    svg
}
