// A chain, and how it is multiplied by the visibility past an occluder; the twin is render::chain. A chain starts as a vertex's
// transfer T. It is kept as SH coefficients, or at the 32 points of a rule (POINT_CHAIN) as the values there times the weights.
// PRODUCT, a place in sh::product_program::STYLES, is how a product of coefficients is computed.
#define FETCHED (COEFFICIENTS > FIELD_COEFFICIENTS ? COEFFICIENTS : FIELD_COEFFICIENTS)

#if POINT_CHAIN
#include "generated/points.glsl"
#define TERMS 32
#else
#include "generated/product.glsl"
#define TERMS COEFFICIENTS
#endif
// The last element of a guarded chain is the square of the length of all but coefficient 0.
#define CHAIN (TERMS + GUARD)

const float CHAIN_Y00 = 0.28209479;

// Coefficient 0 of a chain.
float chain_first(float c[CHAIN]) {
#if POINT_CHAIN
    float first = 0.0;
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        first += CHAIN_Y00 * c[k];
    }
    return first;
#else
    return c[0];
#endif
}

// The square of the length of all the others.
float chain_rest(float c[CHAIN], float first) {
    float rest = 0.0;
#if POINT_CHAIN
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        float apart = c[k] - (CHAIN_Y00 * POINT_WEIGHTS[k]) * first;
        rest += POINT_INVERSES[k] * (apart * apart);
    }
#else
    [[unroll]] for (uint k = 1; k < TERMS; k++) {
        rest += c[k] * c[k];
    }
#endif
    return rest;
}

void chain_begin(float transfer[COEFFICIENTS], out float c[CHAIN]) {
#if POINT_CHAIN
    float v[TERMS];
    sh_points(transfer, v);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = POINT_WEIGHTS[k] * v[k];
    }
#else
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = transfer[k];
    }
#endif
#if GUARD
    c[TERMS] = chain_rest(c, chain_first(c));
#endif
}

// The integral of the chain against a function f of as many bands.
float chain_meet(float c[CHAIN], float f[COEFFICIENTS]) {
    float sum = 0.0;
#if POINT_CHAIN
    float v[TERMS];
    sh_points(f, v);
#define MET v
#else
#define MET f
#endif
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        sum += MET[k] * c[k];
    }
    return sum;
}

#if CAPS
// Takes away what comes from one direction: the chain's value there, over a small solid angle. `y` is the basis in that direction, each
// band a little less for the cap's extent. What a chain has of light is not negative, so a value that is takes nothing, and coefficient
// 0 does not change sign; with that, and up to 1.5 sr, it is no longer than before: the guard has nothing to take back.
void chain_cover(inout float c[CHAIN], float y[COEFFICIENTS], float solid_angle) {
#if POINT_CHAIN
    float v[TERMS];
    sh_points(y, v);
#define COVER_VALUE v
#else
#define COVER_VALUE y
#endif
    float value = 0.0;
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        value += COVER_VALUE[k] * c[k];
    }
    float taken = min(solid_angle * max(value, 0.0), max(chain_first(c), 0.0) / CHAIN_Y00);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
#if POINT_CHAIN
        c[k] -= taken * POINT_WEIGHTS[k] * v[k];
#else
        c[k] -= taken * y[k];
#endif
    }
#if GUARD
    c[TERMS] = chain_rest(c, chain_first(c));
#endif
}
#endif

// Multiplies by 1 - b.
//
// A factor between 0 and 1 makes neither the integral of a function that is nowhere negative larger, nor its length. Cut to a few
// bands it can do both, a little at a time and without end. The guard takes that back: coefficient 0 neither grows nor changes
// sign, and the others are shortened until the whole is no longer than before.
void chain_multiply(inout float c[CHAIN], float b[FETCHED]) {
#if GUARD
    float first_before = chain_first(c);
    float rest_before = c[TERMS];
#endif
#if POINT_CHAIN
    float v[TERMS];
    sh_points(b, v);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] -= c[k] * v[k];
    }
#else
    float t[TERMS];
    float blocked[FIELD_COEFFICIENTS];
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        t[k] = c[k];
    }
    [[unroll]] for (uint k = 0; k < FIELD_COEFFICIENTS; k++) {
        blocked[k] = b[k];
    }
    sh_subtract_product(t, blocked);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = t[k];
    }
#endif
#if GUARD
    float first = chain_first(c);
    float rest = chain_rest(c, first);
    float kept = clamp(first, min(first_before, 0.0), max(first_before, 0.0));
    // What coefficient 0 gives up, the others may take. A factor of 1 changes nothing, to the last bit.
    float room = max(rest_before + (first_before - kept) * (first_before + kept), 0.0);
    float shorten = rest > room ? sqrt(room / rest) : 1.0;
    c[TERMS] = min(rest, room);
#if POINT_CHAIN
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        float even = CHAIN_Y00 * POINT_WEIGHTS[k];
        c[k] = shorten * (c[k] - even * first) + even * kept;
    }
#else
    c[0] = kept;
    [[unroll]] for (uint k = 1; k < TERMS; k++) {
        c[k] *= shorten;
    }
#endif
#endif
}
