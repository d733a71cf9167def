// A chain, and how it is multiplied by the visibility past an occluder; the twin is merge::chain. A chain starts as a
// vertex's transfer T and is kept as SH coefficients.
#include "generated/product.glsl"

#define TERMS COEFFICIENTS
// The last element of a chain is the square of the length of all but coefficient 0.
#define CHAIN (TERMS + 1)

// The square of the length of all coefficients but the first.
float chain_rest(float c[CHAIN]) {
    float rest = 0.0;
    [[unroll]] for (uint k = 1; k < TERMS; k++) {
        rest += c[k] * c[k];
    }
    return rest;
}

void chain_begin(float transfer[COEFFICIENTS], out float c[CHAIN]) {
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = transfer[k];
    }
    c[TERMS] = chain_rest(c);
}

// The coefficients of the chain.
void chain_end(float c[CHAIN], out float transfer[COEFFICIENTS]) {
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        transfer[k] = c[k];
    }
}

// The integral of the chain against a function f of as many bands.
float chain_meet(float c[CHAIN], float f[COEFFICIENTS]) {
    float sum = 0.0;
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        sum += f[k] * c[k];
    }
    return sum;
}

#if SKIP_CAPS
// Takes away what comes from one direction: the chain's value there, over a small solid angle. `y` is the basis in that
// direction, each band a little less for the cap's extent. What a chain has of light is not negative, so a value that
// is takes nothing, and coefficient 0 does not change sign; with that, and up to 1.5 sr, it is no longer than before:
// the guard has nothing to take back.
void chain_cover(inout float c[CHAIN], float y[COEFFICIENTS], float solid_angle) {
    float taken = min(solid_angle * max(chain_meet(c, y), 0.0), max(c[0], 0.0) / Y00);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] -= taken * y[k];
    }
    c[TERMS] = chain_rest(c);
}
#endif

// Multiplies by 1 - b.
//
// A factor between 0 and 1 makes neither the integral of a function that is nowhere negative larger, nor its length.
// Cut to a few bands it can do both, a little at a time and without end. The guard takes that back: coefficient 0
// neither grows nor changes sign, and the others are shortened until the whole is no longer than before.
void chain_multiply(inout float c[CHAIN], float blocked[COEFFICIENTS]) {
    float first_before = c[0];
    float rest_before = c[TERMS];
    float t[TERMS];
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        t[k] = c[k];
    }
    sh_subtract_product(t, blocked);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = t[k];
    }
    float rest = chain_rest(c);
    float kept = clamp(c[0], min(first_before, 0.0), max(first_before, 0.0));
    // What coefficient 0 gives up, the others may take. A factor of 1 changes nothing, to the last bit.
    float room = max(rest_before + (first_before - kept) * (first_before + kept), 0.0);
    float shorten = rest > room ? sqrt(room / rest) : 1.0;
    c[TERMS] = min(rest, room);
    c[0] = kept;
    [[unroll]] for (uint k = 1; k < TERMS; k++) {
        c[k] *= shorten;
    }
}
