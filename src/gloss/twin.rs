//! The CPU twin of pass "gloss" in f64, from the same table and map, and of highlights.
