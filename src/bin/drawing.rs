//! Prints `assets/shadow_field.svg`, the drawing of what a shadow field is, to standard output.
//!
//! Everything in it is computed by the library: the teapot's mesh, the default lattice around it, five captures by the CPU twin of
//! the capture pass, their projections, and the interpolation that a receiver does. A test runs this program and compares its output
//! with the file, byte by byte. To write the file anew: `cargo run --bin drawing > assets/shadow_field.svg`.

use std::fmt::Write as _;
use std::process::ExitCode;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use shadow_fields::Result;
use shadow_fields::asset::{Generator, Mesh};
use shadow_fields::bake::{self, capture, header, project, triangles};
use shadow_fields::field::lattice::{Lattice, Lookup};
use shadow_fields::field::quantity::FieldKind;
use shadow_fields::sh::cube::FACE_COUNT;

/// Squares along an edge of each patch of the teapot: coarse, so that the file stays small.
const TEAPOT_SUBDIVISIONS: u32 = 6;
/// Texels along a face's edge, as in a bake.
const FACE_PX: u32 = 64;
/// Bands and coefficients of the default field.
const BANDS: usize = 4;
const COUNT: usize = BANDS * BANDS;
/// Bounding radius of the object in the drawing, px, and where its centre lies.
const RADIUS_PX: f64 = 140.0;
const CENTRE_PX: DVec2 = DVec2::new(262.0, 212.0);
/// The left part, where the object stands: left, top, width and height, px.
const STAGE: [f64; 4] = [20.0, 58.0, 560.0, 350.0];
/// Where the receiver stands on the floor, in bounding radii from the sphere's centre along x.
const RECEIVER_X: f64 = 1.66;

const SAMPLE_COLOUR: &str = "#d9480f";
const RECEIVER_COLOUR: &str = "#1971c2";

#[allow(clippy::print_stdout, clippy::print_stderr)]
fn main() -> ExitCode {
    match drawing() {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(1)
        }
    }
}

/// The object, the lattice around it, and a receiver; lengths in bounding radii from the bounding sphere's centre.
struct Subject {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    lattice: Lattice,
    /// Height of the floor that the object stands on.
    floor_y: f64,
    receiver: DVec3,
}

/// What was captured at one place: covered texels of six faces, and the SH coefficients of the blocked part.
struct Captured {
    faces: Vec<Vec<bool>>,
    blocked: [f64; COUNT],
}

/// A sample that the receiver reads.
struct Corner {
    position: DVec3,
    weight: f64,
    captured: Captured,
}

impl Subject {
    fn new() -> Result<Self> {
        let mesh: Mesh = Generator::Teapot { subdivisions: TEAPOT_SUBDIVISIONS }.build()?;
        let lattice = header(&mesh, FieldKind::Occlusion, &bake::Options::default()).lattice;
        let positions = triangles::unit_positions(&mesh);
        let floor_y = positions.iter().map(|p| f64::from(p.y)).fold(f64::MAX, f64::min);
        let receiver = DVec3::new(RECEIVER_X, floor_y, 0.0);
        Ok(Subject { positions, triangles: mesh.triangles, lattice, floor_y, receiver })
    }

    /// Captures six faces at `eye` and projects them, by the CPU twins of the two passes.
    fn capture(&self, eye: DVec3) -> Captured {
        let face = |face| capture::twin(&self.positions, &self.triangles, eye, face, FACE_PX);
        let faces: Vec<Vec<bool>> = (0..FACE_COUNT).into_par_iter().map(face).collect();
        let px = FACE_PX as usize;
        let texel = |face: usize, x: usize, y: usize| [if faces[face][y * px + x] { 0.0 } else { 1.0 }; 3];
        let found = project::twin(BANDS, project::Projection::Blocked, px, Vec3::Y, 1.0, texel);
        Captured { blocked: std::array::from_fn(|k| found[k]), faces }
    }

    /// The samples that the receiver reads with a weight above 0, the heaviest first.
    fn corners(&self) -> Vec<Corner> {
        let lattice = &self.lattice;
        let (stored, captured) = (lattice.stored_direction_count(), lattice.direction_count());
        let sources = lattice.sources();
        let found = lattice.corners(self.receiver, Lookup::Trilinear);
        let read = found.index.iter().zip(found.weight).filter(|(_, weight)| *weight > 1e-6);
        let mut corners: Vec<Corner> = read
            .map(|(index, weight)| {
                let position = lattice.position(index / stored * captured + sources[(index % stored) as usize][0]);
                Corner { position, weight, captured: self.capture(position) }
            })
            .collect();
        corners.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        corners
    }

    /// What the receiver interpolates, as the merge does: the stored b / (1 - cos a), weighted, times 1 - cos a of its own place.
    fn interpolated(&self, corners: &[Corner]) -> [f64; COUNT] {
        let lattice = &self.lattice;
        let share = |c: &Corner| c.weight * lattice.scale(lattice.distance(c.position));
        let own = lattice.unscale(lattice.distance(self.receiver));
        std::array::from_fn(|k| own * corners.iter().map(|c| share(c) * c.captured.blocked[k]).sum::<f64>())
    }
}

fn drawing() -> Result<String> {
    let subject = Subject::new()?;
    let corners = subject.corners();
    let sample = &corners[0].captured;
    let mut svg = Figure::new(960, 620);
    stage(&mut svg, &subject, &corners);
    cube_map(&mut svg, sample);

    svg.text([600.0, 344.0], "h", "3  Its 16 SH coefficients");
    svg.bars([600.0, 404.0], &sample.blocked, SAMPLE_COLOUR);

    svg.text([20.0, 446.0], "h", "4  A receiver vertex reads the nearest samples");
    let text = [
        "The vertex on the floor (blue) finds the shells and directions",
        "around it and interpolates the coefficients of eight samples;",
        "the four orange ones lie in the plane of this drawing.",
        "The result says which part of its view the teapot blocks.",
        "When the teapot moves or turns, only the place where the",
        "vertex reads changes; nothing is captured again.",
    ];
    for (line, text) in text.iter().enumerate() {
        svg.text([20.0, 474.0 + 21.0 * line as f64], "t", text);
    }
    svg.text([600.0, 480.0], "t", "blue: interpolated at the vertex");
    svg.text([600.0, 499.0], "t", "black lines: captured there instead");
    svg.bars([600.0, 548.0], &subject.interpolated(&corners), RECEIVER_COLOUR);
    svg.marks([600.0, 548.0], &subject.capture(subject.receiver).blocked);
    Ok(svg.end())
}

/// The left part: shells, sample points, object, floor and receiver.
fn stage(svg: &mut Figure, subject: &Subject, corners: &[Corner]) {
    let [left, top, width, height] = STAGE;
    svg.text([20.0, 40.0], "h", "1  Sample points on shells around an object");
    svg.line(&format!(r#"<clipPath id="c"><rect x="{left}" y="{top}" width="{width}" height="{height}"/></clipPath>"#));
    svg.line(&format!(r##"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="#f1f3f5"/>"##));
    svg.line(r#"<g clip-path="url(#c)">"#);
    let floor = at(DVec3::new(0.0, subject.floor_y, 0.0));
    svg.line(&format!(r##"<rect x="{left}" y="{:.1}" width="{width}" height="{height}" fill="#dee2e6"/>"##, floor.y));
    let (lattice, fit) = (&subject.lattice, subject.lattice.fit());
    let middle = at(DVec3::from(fit.centre));
    svg.line(r##"<g fill="none" stroke="#adb5bd" stroke-width="0.8">"##);
    for shell in 0..lattice.shells {
        let [x, y] = [0, 1].map(|axis| lattice.shell(shell) / fit.stretch[axis] * RADIUS_PX);
        svg.line(&format!(r#"<ellipse cx="{:.1}" cy="{:.1}" rx="{x:.1}" ry="{y:.1}"/>"#, middle.x, middle.y));
    }
    svg.line("</g>");
    teapot(svg, subject);
    svg.line(&format!(
        r##"<circle cx="{}" cy="{}" r="{RADIUS_PX}" fill="none" stroke="#212529" stroke-width="1.2" stroke-dasharray="6 4"/>"##,
        CENTRE_PX.x, CENTRE_PX.y
    ));
    samples(svg, lattice);
    let to = at(subject.receiver);
    for corner in corners {
        let from = at(corner.position);
        let shape = format!(r#"x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}""#, from.x, from.y, to.x, to.y);
        let width = 1.0 + 4.0 * corner.weight;
        svg.line(&format!(r#"<line {shape} stroke="{RECEIVER_COLOUR}" stroke-width="{width:.1}"/>"#));
    }
    for (index, corner) in corners.iter().enumerate() {
        svg.dot(at(corner.position), if index == 0 { 5.0 } else { 3.5 }, SAMPLE_COLOUR);
    }
    svg.dot(to, 5.0, RECEIVER_COLOUR);
    svg.line("</g>");
    let sample = at(corners[0].position);
    svg.text([30.0, 84.0], "l", "bounding sphere, radius r");
    svg.text([400.0, 84.0], "l", "shells of sample points");
    svg.text([sample.x - 92.0, sample.y + 60.0], "l", "the sample of 2 and 3");
    svg.line(&format!(
        r#"<path d="M{:.1} {:.1}V{:.1}" stroke="{SAMPLE_COLOUR}"/>"#,
        sample.x,
        sample.y + 6.0,
        sample.y + 44.0
    ));
    svg.text([to.x - 40.0, to.y - 62.0], "l", "receiver vertex");
    svg.line(&format!(r#"<path d="M{:.1} {:.1}V{:.1}" stroke="{RECEIVER_COLOUR}"/>"#, to.x, to.y - 6.0, to.y - 56.0));
    let count = format!("{} shells in all, the outermost at {} r", lattice.shells, lattice.outer);
    svg.text([32.0, 398.0], "l", &count);
}

/// The triangles that face the viewer, shaded by how much they do; far ones first.
fn teapot(svg: &mut Figure, subject: &Subject) {
    let mut facing: Vec<(f64, usize, [DVec2; 3])> = Vec::new();
    for triangle in &subject.triangles {
        let [a, b, c] = triangle.map(|i| subject.positions[i as usize].as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal.z > 0.0 {
            let light = normal.dot(DVec3::new(-0.35, 0.65, 0.68)).max(0.0);
            facing.push(((a.z + b.z + c.z) / 3.0, (light * 20.0).round() as usize, [a, b, c].map(at)));
        }
    }
    facing.sort_by(|a, b| a.0.total_cmp(&b.0));
    svg.line(r#"<g stroke-width="0.7" stroke-linejoin="round">"#);
    for shades in facing.chunk_by(|a, b| a.1 == b.1) {
        let grey = 70 + 6 * shades[0].1;
        let mut path = String::new();
        for (_, _, [a, b, c]) in shades {
            let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1} {:.1} {:.1}z", a.x, a.y, b.x, b.y, c.x, c.y);
        }
        let colour = format!("#{grey:02x}{grey:02x}{:02x}", (grey + 12).min(255));
        svg.line(&format!(r#"<path fill="{colour}" stroke="{colour}" d="{path}"/>"#));
    }
    svg.line("</g>");
}

/// The sample points that lie in the plane of the drawing, as one path of round dots.
fn samples(svg: &mut Figure, lattice: &Lattice) {
    let [left, top, width, height] = STAGE;
    let mut path = String::new();
    for sample in 0..lattice.sample_count() {
        let direction = sample % lattice.direction_count();
        let position = lattice.position(sample);
        let p = at(position);
        let shown = (left..left + width).contains(&p.x) && (top..top + height).contains(&p.y);
        if shown && position.z.abs() < 1e-9 && lattice.first_of(direction) == direction {
            let _ = write!(path, "M{:.1} {:.1}h0", p.x, p.y);
        }
    }
    svg.line(&format!(
        r##"<path d="{path}" stroke="#fff" stroke-width="4.4" stroke-linecap="round"/><path d="{path}" stroke="#343a40" stroke-width="3" stroke-linecap="round"/>"##
    ));
}

/// Six faces unfolded to a cross; covered texels dark.
fn cube_map(svg: &mut Figure, captured: &Captured) {
    const FACE: f64 = 80.0;
    let places = [(2.0, 1.0), (0.0, 1.0), (1.0, 0.0), (1.0, 2.0), (1.0, 1.0), (3.0, 1.0)];
    let names = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];
    svg.text([600.0, 40.0], "h", "2  One captured cube map");
    for (face, (column, row)) in places.into_iter().enumerate() {
        let (x, y) = (600.0 + FACE * column, 62.0 + FACE * row);
        svg.line(&format!(
            r##"<rect x="{x}" y="{y}" width="{FACE}" height="{FACE}" fill="#fff" stroke="#868e96"/><path fill="#212529" transform="translate({x} {y}) scale({})" d="{}"/>"##,
            FACE / f64::from(FACE_PX),
            runs(&captured.faces[face])
        ));
        svg.text([x + 5.0, y + FACE - 6.0], "f", names[face]);
    }
    for (line, text) in ["six faces, seen from", "the large orange point;", "black: blocked"].iter().enumerate() {
        svg.text([770.0, 244.0 + 19.0 * line as f64], "t", text);
    }
}

/// Rows of covered texels as rectangles of a path, one texel being one unit.
fn runs(covered: &[bool]) -> String {
    let mut path = String::new();
    for (y, row) in covered.chunks(FACE_PX as usize).enumerate() {
        let mut x = 0;
        for run in row.chunk_by(|a, b| a == b) {
            if run[0] {
                let _ = write!(path, "M{x} {y}h{0}v1h-{0}z", run.len());
            }
            x += run.len();
        }
    }
    path
}

/// A place in the plane of the drawing, px.
fn at(position: DVec3) -> DVec2 {
    CENTRE_PX + RADIUS_PX * DVec2::new(position.x, -position.y)
}

/// The file as it is written.
struct Figure(String);

/// Step from bar to bar and height of a coefficient of 1, px.
const BAR_STEP: f64 = 20.0;
const BAR_UNIT: f64 = 190.0;

impl Figure {
    fn new(width: u32, height: u32) -> Self {
        let mut svg = Figure(String::new());
        svg.line(&format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif">"#
        ));
        svg.line("<title>What a shadow field is</title>");
        svg.line(
            "<style>text{fill:#212529}.h{font-size:18px;font-weight:600}.t{font-size:15px}.f{font-size:13px;fill:#868e96}.l{font-size:14px;paint-order:stroke;stroke:#f1f3f5;stroke-width:5px;stroke-linejoin:round}.m{font-size:13px;text-anchor:middle;fill:#495057}</style>",
        );
        svg.line(&format!(r##"<rect width="{width}" height="{height}" rx="10" fill="#fff" stroke="#dee2e6"/>"##));
        svg
    }

    fn end(mut self) -> String {
        self.line("</svg>");
        self.0
    }

    fn line(&mut self, text: &str) {
        self.0.push_str(text);
        self.0.push('\n');
    }

    fn text(&mut self, [x, y]: [f64; 2], class: &str, text: &str) {
        self.line(&format!(r#"<text x="{x:.1}" y="{y:.1}" class="{class}">{text}</text>"#));
    }

    fn dot(&mut self, at: DVec2, radius: f64, colour: &str) {
        self.line(&format!(
            r##"<circle cx="{:.1}" cy="{:.1}" r="{radius}" fill="{colour}" stroke="#fff"/>"##,
            at.x, at.y
        ));
    }

    /// Bars up and down from a line at the given left end, with the bands named below.
    fn bars(&mut self, [x, y]: [f64; 2], values: &[f64; COUNT], colour: &str) {
        for (k, value) in values.iter().enumerate() {
            let (height, low) = (value.abs() * BAR_UNIT, y - value.max(0.0) * BAR_UNIT);
            let left = x + BAR_STEP * k as f64 + 3.0;
            self.line(&format!(
                r#"<rect x="{left:.1}" y="{low:.1}" width="14" height="{height:.1}" fill="{colour}"/>"#
            ));
        }
        let right = x + BAR_STEP * COUNT as f64;
        self.line(&format!(r##"<path d="M{x} {y}H{right}" stroke="#212529"/>"##));
        for band in 0..BANDS {
            let (first, last) = (band * band, (band + 1) * (band + 1));
            let middle = x + BAR_STEP * (first + last) as f64 / 2.0;
            self.text([middle, y + 52.0], "m", &band.to_string());
            let (left, right) = (x + BAR_STEP * first as f64 + 2.0, x + BAR_STEP * last as f64 - 2.0);
            self.line(&format!(r##"<path d="M{left} {0}H{right}" stroke="#868e96"/>"##, y + 38.0));
        }
        self.text([right + 5.0, y + 52.0], "f", "band");
    }

    /// Short lines where bars of these values would end.
    fn marks(&mut self, [x, y]: [f64; 2], values: &[f64; COUNT]) {
        let mut path = String::new();
        for (k, value) in values.iter().enumerate() {
            let _ = write!(path, "M{:.1} {:.1}h18", x + BAR_STEP * k as f64 + 1.0, y - value * BAR_UNIT);
        }
        self.line(&format!(r##"<path d="{path}" stroke="#000" stroke-width="2"/>"##));
    }
}
