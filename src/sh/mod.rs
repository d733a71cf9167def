//! Spherical harmonics in f64: the maths that bakes, shaders and their tests use. It needs no Vulkan and no files.
//!
//! Conventions, tested in `tests/maths/sh`:
//!
//! - real orthonormal basis with the Condon-Shortley phase (reference 1): Y1,-1 = -0.488603 y, Y1,0 = 0.488603 z, Y1,1
//!   = -0.488603 x; coefficient l (l + 1) + m; n bands are n^2 coefficients, 1 to [`MAX_BANDS`];
//! - directions are unit vectors of a right-handed space, taken as they stand: no axes are swapped;
//! - a function is a blocked part, a radiance or a transfer; its coefficients have its unit;
//! - cube faces +X -X +Y -Y +Z -Z with Vulkan's s and t ([`cube`]).
//!
//! | file | holds |
//! |---|---|
//! | [`basis`] | evaluation of the basis, and its GLSL |
//! | [`quadrature`] | exact rules on the sphere |
//! | [`cube`] | faces, texels, solid angles |
//! | [`mod@project`] | texels to coefficients |
//! | [`product`] | the triple-product tensor, products |
//! | [`product_program`] | the product as straight-line code, and its GLSL |
//! | [`rotation`] | block-diagonal rotation, and its GLSL |
//! | [`lobe`] | closed forms: caps, the clamped cosine |
//! | [`polygon`] | the closed form of flat polygons |
//! | [`program`] | straight-line programs: run by tests, printed for shaders |
//!
//! # References
//!
//! 1. P.-P. Sloan, *Stupid Spherical Harmonics (SH) Tricks*, GDC 2008: basis, phase, zonal rotation, triple products.
//! 2. P.-P. Sloan, *Efficient Spherical Harmonic Evaluation*, JCGT 2 (2), 2013: polynomials in x, y, z.
//! 3. J. Snyder, *Code Generation and Factoring for Fast Evaluation of Low-order Spherical Harmonic Products and
//!    Squares*, MSR-TR-2006-53, 2006: the product's sparsity and what factoring saves.
//! 4. R. Ramamoorthi, P. Hanrahan, *An Efficient Representation for Irradiance Environment Maps*, SIGGRAPH 2001: the
//!    clamped cosine.
//! 5. A. D. McLaren, *Optimal Numerical Integration on a Sphere*, Mathematics of Computation 17, 1963: the 32-point
//!    rule.
//! 6. A. van Oosterom, J. Strackee, *The Solid Angle of a Plane Triangle*, IEEE Transactions on Biomedical Engineering
//!    30 (2), 1983.

pub mod basis;
pub mod cube;
pub mod lobe;
pub mod polygon;
pub mod product;
pub mod product_program;
pub mod program;
pub mod project;
pub mod quadrature;
pub mod rotation;

pub use basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, evaluate, glsl_basis};
pub use product::Tensor;
pub use project::project;
pub use rotation::{Rotation, glsl_rotate};
