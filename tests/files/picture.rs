//! Pictures written and read back.

use crate::common::names;
use shadow_fields::asset::picture::{
    encode_srgb, linear_from_srgb, srgb_from_linear, write_apng, write_png, write_whole,
};
use std::io::BufReader;
use std::path::Path;

#[test]
fn srgb_curve() {
    // IEC 61966-2-1 in f64: 18 % grey, both sides of the joint, and the ends.
    for linear in [0.0, 0.001, 0.0031308, 0.0031309, 0.18, 0.5, 1.0f64] {
        let expected = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
        assert!((f64::from(srgb_from_linear(linear as f32)) - expected).abs() < 3e-7, "{linear}");
    }
    for code in 0..=255u8 {
        let linear = linear_from_srgb(f32::from(code) / 255.0);
        assert_eq!(encode_srgb(&[linear], 0.0), [code]);
    }
    let odd = [-1.0, 2.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.18];
    assert_eq!(encode_srgb(&odd, 0.0), [0, 255, 0, 255, 0, 118]);
    assert_eq!(encode_srgb(&[0.09], 1.0), encode_srgb(&[0.18], 0.0));
}

#[test]
fn png_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    let pixels: Vec<f32> = (0..5 * 3 * 3).map(|i| i as f32 / 20.0).collect();
    write_png(&path, 5, 3, &pixels, -1.0).unwrap();
    write_png(&path, 5, 3, &pixels, -1.0).unwrap();
    assert_eq!(names(folder.path()), ["p.png"], "nothing else is left behind");
    let mut reader = png::Decoder::new(BufReader::new(std::fs::File::open(&path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.width, info.height), (5, 3));
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    assert_eq!(bytes, encode_srgb(&pixels, -1.0));
    let text = &reader.info().uncompressed_latin1_text;
    assert_eq!((text[0].keyword.as_str(), text[0].text.as_str()), ("Exposure", "-1 EV"));
    assert!(reader.info().srgb.is_some());
}

#[test]
fn apng_has_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    let frames: Vec<Vec<u8>> = (0..7u8).map(|f| vec![f * 30; 4 * 2 * 3]).collect();
    let all = || frames.iter().cloned().map(Ok);
    write_apng(&path, 4, 2, all(), 25).unwrap();
    let mut reader = png::Decoder::new(BufReader::new(std::fs::File::open(&path).unwrap())).read_info().unwrap();
    let control = reader.info().animation_control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (7, 0));
    for frame in &frames {
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(&bytes, frame);
        let shown = reader.info().frame_control.unwrap();
        assert_eq!((shown.delay_num, shown.delay_den), (1, 25));
    }
    assert_eq!(write_apng(&path, 4, 2, std::iter::empty(), 25).unwrap_err().exit_code(), 2);
    assert_eq!(write_apng(&path, 4, 2, all(), 0).unwrap_err().exit_code(), 2);
    // A frame that fails is what fails, and the older file stays.
    let before = std::fs::read(&path).unwrap();
    let broken = [Ok(frames[0].clone()), Err(shadow_fields::Error::Device("gone".into()))];
    assert_eq!(write_apng(&path, 4, 2, broken.into_iter(), 25).unwrap_err().exit_code(), 5);
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn failure_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    write_png(&path, 1, 1, &[0.5; 3], 0.0).unwrap();
    let before = std::fs::read(&path).unwrap();
    let error = write_whole(&path, |file| {
        file.write_all(b"half")?;
        Err("no more".into())
    });
    let message = error.unwrap_err().to_string();
    assert!(message.contains("p.png: cannot be written: no more"), "{message}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(names(folder.path()), ["p.png"]);
    for bad in [folder.path().join("none/p.png"), folder.path().to_owned()] {
        let error = write_png(&bad, 1, 1, &[0.5; 3], 0.0).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().starts_with(bad.to_str().unwrap()), "{error}");
    }
    // Not a regular file: written to, not replaced.
    #[cfg(unix)]
    {
        write_png(Path::new("/dev/null"), 1, 1, &[0.5; 3], 0.0).unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
    }
}
