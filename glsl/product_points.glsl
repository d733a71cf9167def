// A chain that stays at the 32 points of a rule, as the values there times the weights, and is projected once at its
// end: exact for one factor only. `bench product` compares it with merge_product.glsl. The functions have the same
// names; its twin is merge::chain.
#include "generated/points.glsl"

#define FETCHED COEFFICIENTS
#define TERMS 32
// The last element of a guarded chain is the square of the length of all but coefficient 0.
#define CHAIN (TERMS + GUARD)

// Coefficient 0 of a chain.
float chain_first(float c[CHAIN]) {
    float first = 0.0;
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        first += Y00 * c[k];
    }
    return first;
}

// The square of the length of all the others.
float chain_rest(float c[CHAIN], float first) {
    float rest = 0.0;
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        float apart = c[k] - (Y00 * POINT_WEIGHTS[k]) * first;
        rest += POINT_INVERSES[k] * (apart * apart);
    }
    return rest;
}

void chain_begin(float transfer[COEFFICIENTS], out float c[CHAIN]) {
    float v[TERMS];
    sh_points(transfer, v);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] = POINT_WEIGHTS[k] * v[k];
    }
#if GUARD
    c[TERMS] = chain_rest(c, chain_first(c));
#endif
}

// The coefficients of the chain.
void chain_end(float c[CHAIN], out float transfer[COEFFICIENTS]) {
    float values[TERMS];
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        values[k] = c[k];
    }
    sh_from_points(values, transfer);
}

// Multiplies by 1 - b, guarded as in merge_product.glsl.
void chain_multiply(inout float c[CHAIN], float b[FETCHED]) {
#if GUARD
    float first_before = chain_first(c);
    float rest_before = c[TERMS];
#endif
    float v[TERMS];
    sh_points(b, v);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        c[k] -= c[k] * v[k];
    }
#if GUARD
    float first = chain_first(c);
    float rest = chain_rest(c, first);
    float kept = clamp(first, min(first_before, 0.0), max(first_before, 0.0));
    float room = max(rest_before + (first_before - kept) * (first_before + kept), 0.0);
    float shorten = rest > room ? sqrt(room / rest) : 1.0;
    c[TERMS] = min(rest, room);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        float even = Y00 * POINT_WEIGHTS[k];
        c[k] = shorten * (c[k] - even * first) + even * kept;
    }
#endif
}
