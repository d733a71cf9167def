//! Roots, quotients and angles from products and sums alone: in f32 these are rounded in one way on every device, which
//! divisions and library functions are not. So host and device come to the same bits, and lists made by either are the same.
//!
//! `glsl/repeatable.glsl` holds the same functions under the same names. Rust never contracts a product and a sum into one
//! operation; the shader forbids it with `precise`.

/// 1 / sqrt(x) within 3e-7 of itself, x from 1e-30 up: Newton's iteration from a first guess by the exponent.
pub fn inverse_root(x: f32) -> f32 {
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y
}

/// sqrt(x); 0 for what is not above 1e-30.
pub fn root(x: f32) -> f32 {
    let x = x.max(1e-30);
    if x > 1e-30 { x * inverse_root(x) } else { 0.0 }
}

/// 1 / x, x from 1e-15 to 1e15.
pub fn inverse(x: f32) -> f32 {
    let y = inverse_root(x);
    let y = y * y;
    y * (2.0 - x * y)
}

/// Sum of products.
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// An angle from 0 to pi as its cosine and sine; sums beyond pi stay there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Cosine.
    pub cosine: f32,
    /// Sine, at least 0.
    pub sine: f32,
}

impl Angle {
    /// From its sine, up to a right angle.
    pub fn of_sine(sine: f32) -> Self {
        Angle { cosine: root((1.0 - sine) * (1.0 + sine)), sine }
    }

    /// From its cosine.
    pub fn of_cosine(cosine: f32) -> Self {
        let cosine = cosine.clamp(-1.0, 1.0);
        Angle { cosine, sine: root((1.0 - cosine) * (1.0 + cosine)) }
    }

    /// The sum of two.
    pub fn plus(self, other: Angle) -> Angle {
        // cos a + cos b = 2 cos((a + b) / 2) cos((a - b) / 2)
        if self.cosine + other.cosine < 0.0 {
            return Angle { cosine: -1.0, sine: 0.0 };
        }
        let sine = self.sine * other.cosine + self.cosine * other.sine;
        Angle { cosine: self.cosine * other.cosine - self.sine * other.sine, sine: sine.max(0.0) }
    }

    /// Cosine of what is left of it without `other`; 1 where nothing is left.
    pub fn cosine_less(self, other: Angle) -> f32 {
        if self.cosine >= other.cosine { 1.0 } else { self.cosine * other.cosine + self.sine * other.sine }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_what_they_are_called() {
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..10_000 {
            let x = 10_f64.powf(20.0 * rng.f64() - 10.0);
            let f = x as f32;
            let close = |a: f32, b: f64| assert!((f64::from(a) / b - 1.0).abs() < 6e-7, "{a} {b} of {x}");
            close(inverse_root(f), f64::from(f).sqrt().recip());
            close(root(f), f64::from(f).sqrt());
            close(inverse(f), f64::from(f).recip());
        }
        assert_eq!(root(0.0), 0.0);
        assert_eq!(root(-1e-9), 0.0);
    }

    #[test]
    fn angles_add_up_to_half_a_turn() {
        use std::f32::consts::PI;
        let mut rng = fastrand::Rng::with_seed(6);
        for _ in 0..10_000 {
            let (a, b) = (PI * rng.f32(), PI * rng.f32());
            let of = |x: f32| Angle { cosine: x.cos(), sine: x.sin().max(0.0) };
            let sum = of(a).plus(of(b));
            assert!((sum.cosine - (a + b).min(PI).cos()).abs() < 1e-5, "{a} {b}");
            assert!((of(a).cosine_less(of(b)) - (a - b).max(0.0).cos()).abs() < 1e-5, "{a} {b}");
        }
        let half = Angle { cosine: -1.0, sine: 0.0 };
        assert_eq!(half.plus(half), half);
    }
}
