//! Meshes: generators against closed forms, derived properties, the enclosing sphere, and OBJ files.

use crate::common::{generate, inside_out, joined, teapot};
use generate::{cuboid, plane, sphere, torus, torus_two_colour};
use glam::{DVec3, Quat, Vec2, Vec3};
use shadow_fields::asset::{Generator, Mesh, embedded, enclose};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// f32 positions: a few roundings of 6e-8 each, summed over many triangles of either sign.
const F32: f64 = 1e-6;

/// The built-in meshes, all but the teapot as the generators make them.
fn library() -> Vec<Mesh> {
    let two_colours = torus_two_colour(0.5, 0.15, 48, 20);
    vec![plane(6.0, 32), sphere(0.5, 3), torus(0.5, 0.2, 48, 24), two_colours, cuboid(Vec3::ONE, 6), teapot()]
}

fn close(value: f64, expected: f64, relative: f64) {
    assert!((value - expected).abs() <= relative * expected.abs(), "{value} is not {expected} within {relative}");
}

#[test]
fn shape_table() {
    // mesh, closed, convex, flat, Euler characteristic (2 - 2 handles for closed ones, 1 for a disc)
    let table = [
        (plane(6.0, 7), false, false, true, 1),
        (sphere(0.7, 0), true, true, false, 2),
        (sphere(0.7, 5), true, true, false, 2),
        (torus(0.5, 0.2, 48, 24), true, false, false, 0),
        (torus_two_colour(0.5, 0.15, 48, 20), true, false, false, 0),
        (cuboid(Vec3::new(0.3, 1.0, 2.5), 1), true, true, false, 2),
        (cuboid(Vec3::new(0.3, 1.0, 2.5), 6), true, true, false, 2),
    ];
    for (mesh, closed, convex, flat, euler) in table {
        let found = (mesh.is_closed(), mesh.is_convex(), mesh.is_flat(), mesh.euler_characteristic());
        assert_eq!(found, (closed, convex, flat, euler), "{}", mesh.name);
    }
    assert!(!teapot().is_closed() && !teapot().is_convex() && !teapot().is_flat());
}

#[test]
fn volumes_and_areas() {
    close(plane(3.0, 9).area_m2(), 9.0, F32);
    let size = Vec3::new(0.3, 1.0, 2.5);
    close(cuboid(size, 5).volume_m3(), 0.75, F32);
    close(cuboid(size, 5).area_m2(), 2.0 * (0.3 + 0.75 + 2.5), F32);
    // A polyhedron inscribed in a sphere: its volume and area fall short by O(h^2); four times less a subdivision.
    let short = |s| 1.0 - sphere(1.0, s).volume_m3() / (4.0 / 3.0 * PI);
    assert!(short(5) > 0.0 && short(5) < 2e-3, "{}", short(5));
    assert!((short(4) / short(5) - 4.0).abs() < 0.05);
    close(sphere(1.0, 6).area_m2(), 4.0 * PI, 1e-3);
    // An inscribed n-gon has sin(2 pi / n) / (2 pi / n) of the area of its circle.
    let inscribed = |n: f64| (TAU / n).sin() / (TAU / n);
    let (major, minor, segments, sides) = (0.5, 0.2, 96.0, 48.0);
    // Pappus for the cross-section; around the axis every wedge is cut by a chord in the same ratio.
    let volume = 2.0 * PI * PI * major * minor * minor * inscribed(segments) * inscribed(sides);
    close(torus(0.5, 0.2, 96, 48).volume_m3(), volume, 2e-4);
    close(torus(0.5, 0.2, 192, 96).area_m2(), 4.0 * PI * PI * major * minor, 2e-3);
}

#[test]
fn normals_are_unit_and_face_outwards() {
    for mesh in library() {
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        assert!(mesh.normals.iter().all(|n| (n.as_dvec3().length() - 1.0).abs() < 1e-6), "{}", mesh.name);
        let (mut agree, mut corners) = (0, 0);
        for t in &mesh.triangles {
            let p = t.map(|i| mesh.positions[i as usize].as_dvec3());
            let face = (p[1] - p[0]).cross(p[2] - p[0]);
            for &i in t {
                corners += 1;
                agree += usize::from(face.dot(mesh.normals[i as usize].as_dvec3()) > 0.0);
            }
        }
        assert!(agree as f64 > 0.999 * f64::from(corners), "{}: {agree} of {corners}", mesh.name);
    }
}

/// Slow twin: the smallest ball through every two, three or four points that holds all.
fn brute_ball(points: &[DVec3]) -> f64 {
    let holds = |c: DVec3, r: f64| points.iter().all(|p| p.distance(c) <= r * (1.0 + 1e-9));
    let mut best = f64::INFINITY;
    let n = points.len();
    let mut consider = |c: DVec3, r: f64| {
        if r < best && holds(c, r) {
            best = r;
        }
    };
    for a in 0..n {
        for b in a + 1..n {
            let (p, q) = (points[a], points[b]);
            consider((p + q) * 0.5, p.distance(q) * 0.5);
            for &r in &points[b + 1..] {
                // Circumcentre of a triangle by the cross product form.
                let (u, v) = (q - p, r - p);
                let w = u.cross(v);
                let c = p
                    + (w.cross(u) * v.length_squared() + v.cross(w) * u.length_squared()) / (2.0 * w.length_squared());
                consider(c, c.distance(p));
                for &s in points {
                    // Circumcentre of a tetrahedron: along the triangle's axis until s is as far as p.
                    let axis = w / w.length();
                    let height = (s - p).dot(axis);
                    if height.abs() > 1e-6 {
                        let t = ((s - c).length_squared() - (p - c).length_squared()) / (2.0 * height);
                        consider(c + axis * t, (c + axis * t).distance(p));
                    }
                }
            }
        }
    }
    best
}

#[test]
fn bounding_sphere_is_smallest() {
    let mut random = fastrand::Rng::with_seed(11);
    for _ in 0..60 {
        let count = random.usize(2..14);
        let points: Vec<Vec3> = (0..count)
            .map(|_| Vec3::from_array(std::array::from_fn(|k| (random.f32() - 0.3) * [1.0, 4.0, 0.2][k])))
            .collect();
        let (centre, radius) = enclose::bounding_sphere(&points);
        assert!(points.iter().all(|p| p.distance(centre) <= radius));
        let exact = brute_ball(&points.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>());
        // The centre is rounded to f32: 6e-8 of coordinates up to 3, radii from about 0.1 on.
        assert!((f64::from(radius) - exact).abs() < 2e-6 * exact.max(0.1), "{radius} against {exact}");
    }
    // A ball far away.
    let moved: Vec<Vec3> = sphere(0.37, 4).positions.iter().map(|p| *p + Vec3::new(1000.0, -20.0, 3.0)).collect();
    let (centre, r) = enclose::bounding_sphere(&moved);
    assert!(centre.distance(Vec3::new(1000.0, -20.0, 3.0)) < 1e-4 && (r - 0.37).abs() < 1e-4);
    assert!(moved.iter().all(|p| p.distance(centre) <= r));
    assert_eq!(enclose::bounding_sphere(&[Vec3::ONE]), (Vec3::ONE, 0.0));
}

#[test]
fn shape_survives_rotation_and_refuses_defects() {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, 0.8, -0.5).normalize(), 1.1);
    let turned = |mesh: &Mesh| {
        let all = |v: &[Vec3]| v.iter().map(|p| turn * *p).collect::<Vec<_>>();
        Mesh::new("turned", all(&mesh.positions), all(&mesh.normals), None, mesh.triangles.clone()).unwrap()
    };
    // Split normals give every corner of a box three vertices; rotation rounds equal positions alike.
    assert!(turned(&cuboid(Vec3::new(1.0, 0.2, 3.0), 9)).is_convex());
    assert!(turned(&sphere(1.0, 5)).is_convex());
    // Rounding of coordinates dents a small ball that stands far from the origin.
    let aside = joined(&[(&sphere(0.05, 3), Vec3::new(5.0, 2.4, -3.0))]);
    assert!(aside.is_convex() && aside.ball_share().is_some());
    assert!(!joined(&[(&torus(0.05, 0.02, 24, 12), Vec3::X * 1000.0)]).is_convex());
    assert!(turned(&plane(1.0, 50)).is_flat());
    let rebuild =
        |mesh: &Mesh, triangles| Mesh::new("x", mesh.positions.clone(), mesh.normals.clone(), None, triangles).unwrap();
    let ball = sphere(1.0, 2);
    assert!(!rebuild(&ball, ball.triangles[1..].to_vec()).is_closed(), "a hole");
    assert!(!inside_out(&ball).is_closed(), "inside out");
    let mut one_turned = ball.triangles.clone();
    one_turned[5].swap(0, 1);
    assert!(!rebuild(&ball, one_turned).is_closed(), "one triangle turned over");
    let mut twice = ball.triangles.clone();
    twice.push(twice[0]);
    assert!(!rebuild(&ball, twice).is_closed(), "one triangle twice");
    let mut dented = ball.clone();
    dented.positions[7] *= 0.9;
    let dented = rebuild(&dented, ball.triangles.clone());
    assert!(dented.is_closed() && !dented.is_convex(), "a dent");
    let mut bent = plane(1.0, 4);
    bent.positions[3].y = 1e-3;
    assert!(!rebuild(&bent, bent.triangles.clone()).is_flat());
}

#[test]
fn pieces_and_contacts() {
    let cube = cuboid(Vec3::ONE, 1);
    let beside = |mesh: &Mesh, by: Vec3| joined(&[(mesh, Vec3::ZERO), (mesh, by)]);
    let apart = beside(&cube, Vec3::X * 3.0);
    assert!(apart.is_closed() && !apart.is_convex() && apart.euler_characteristic() == 4);
    assert!(apart.is_solid() && sphere(1.0, 2).is_solid() && torus(1.0, 0.3, 12, 8).is_solid() && !teapot().is_solid());
    let hollow = joined(&[(&cuboid(Vec3::splat(3.0), 1), Vec3::ZERO), (&inside_out(&cube), Vec3::ZERO)]);
    assert!(hollow.is_closed() && !hollow.is_solid(), "a hollow in a box");
    assert!(!beside(&cube, Vec3::ONE).is_closed(), "two boxes that share one corner are no manifold");
    assert!(!beside(&cube, Vec3::new(1.0, 1.0, 0.0)).is_closed(), "nor are two that share an edge");
}

#[test]
fn missing_normals_are_computed() {
    let ball = sphere(1.0, 4);
    let bare = Mesh::new("bare", ball.positions.clone(), vec![], None, ball.triangles.clone()).unwrap();
    for (given, computed) in ball.normals.iter().zip(&bare.normals) {
        // Angle weights on a nearly regular mesh: the error is that of the triangulation, O(h^2) with h = 0.07.
        assert!(given.distance(*computed) < 5e-3, "{given} {computed}");
    }
    // Where one given normal has no length, that one is computed.
    let mut normals = ball.normals.clone();
    normals[9] = Vec3::ZERO;
    let mended = Mesh::new("mended", ball.positions.clone(), normals, None, ball.triangles.clone()).unwrap();
    assert!(mended.normals[9].distance(ball.normals[9]) < 5e-3 && mended.normals[8] == ball.normals[8]);
}

#[test]
fn needles_and_duplicates_are_tolerated() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 0 0\nv 0 1 0\nv .5 0 0\nf 1 2 4\nf 1 2 3\nf 1 1 4\nf 1 5 2\n";
    let mesh = Mesh::parse(text.as_bytes(), Path::new("x.obj")).unwrap();
    assert_eq!(mesh.triangles.len(), 2, "the triangle and the needle with three different corners");
    assert!(mesh.normals.iter().all(|n| n.is_finite() && (n.length() - 1.0).abs() < 1e-6));
}

/// Read to the bit.
#[test]
fn built_in_meshes_are_those_of_their_generators() {
    for mesh in library() {
        let path = format!("assets/meshes/{}.obj", mesh.name);
        let read = Mesh::parse(&embedded::read(Path::new(&path)).unwrap(), Path::new(&path)).unwrap();
        assert_eq!(read, mesh, "{path}");
    }
}

#[test]
fn obj_dialects() {
    let parse = |text: &str| Mesh::parse(text.as_bytes(), Path::new("x.obj")).unwrap();
    let plain = parse("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    assert_eq!(plain.triangles.len(), 2);
    assert!(plain.normals.iter().all(|n| n.distance(Vec3::Z) < 1e-6));
    let same = [
        "mtllib none.mtl\no a\nv 0 0 0 1\nv 1 0 0\ng b\nv 1 1 0 # far\nv 0 1 0\nusemtl m\nvt 0 0\nf -4/1 -3/1 -2/1 -1/1\n",
        "f 1 2 3 4\r\nv 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1/2/1 2//1 3//1 4\nl 1 2\np 3\n",
    ];
    for text in same {
        let found = parse(text);
        assert_eq!((found.positions, found.triangles), (plain.positions.clone(), plain.triangles.clone()), "{text}");
        assert_eq!(found.normals, plain.normals, "{text}");
    }
    let textured =
        parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0\nvt .5 1\nvt 1 0 0\nf 1/1 2/2 3/3\nf 4/-3 3/3 2/1\n");
    let uvs = textured.uvs.as_ref().unwrap();
    let wanted = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]].map(Vec2::from);
    assert_eq!(uvs[..], wanted, "a seam splits a vertex");
    assert!(parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3\n").uvs.is_none(), "one corner has none");
    let split = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 2\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 4//2 2//2\n");
    assert_eq!((split.positions.len(), split.normals[0]), (6, Vec3::Z), "two normals at two of the positions");
    let colored = parse("v 0 0 0 1 0 0\nv 1 0 0 0 2 0\nv 0 1 0 0 0 .5\nf 1 2 3\n");
    assert_eq!(colored.colors.unwrap(), [Vec3::X, Vec3::Y * 2.0, Vec3::Z * 0.5]);
}

#[test]
fn generators_refuse_bad_numbers() {
    let bad = [
        Generator::Plane { size_m: 0.0, cells: 4 },
        Generator::Plane { size_m: f32::NAN, cells: 4 },
        Generator::Plane { size_m: 1.0, cells: 0 },
        Generator::Plane { size_m: 1.0, cells: u32::MAX },
        Generator::Sphere { radius_m: -1.0, subdivisions: 2 },
        Generator::Sphere { radius_m: 1.0, subdivisions: 9 },
        Generator::Torus { major_m: 0.2, minor_m: 0.3, segments: 8, sides: 8 },
        Generator::Torus { major_m: 0.2, minor_m: 0.1, segments: 2, sides: 8 },
        Generator::Torus { major_m: 0.2, minor_m: 0.1, segments: 8, sides: 2 },
        Generator::Torus { major_m: 0.2, minor_m: 0.1, segments: u32::MAX, sides: 8 },
        Generator::TorusTwoColour { major_m: 0.2, minor_m: 0.0, segments: 8, sides: 8 },
        Generator::Disc { radius_m: 0.0 },
        Generator::Rectangle { size_m: [1.0, f32::INFINITY] },
        Generator::Cuboid { size_m: Vec3::new(1.0, 0.0, 1.0), cells: 2 },
    ];
    for generator in bad {
        let error = generator.build().expect_err(&format!("{generator:?}"));
        assert_eq!(error.exit_code(), 4);
        assert!(!error.to_string().contains('\n'));
    }
}
