/* The numbers of a player without floating point, as classes of C++: what player.c is compiled with where MD_FIXED is
   defined. All are whole numbers of a small unit; those of 32 bits are saturated where they are multiplied or divided. */
#ifndef MOTIONDECK_FIXED_H
#define MOTIONDECK_FIXED_H
#include <math.h>
#include <stdint.h>

#ifdef __GNUC__
#define MD_INLINED __attribute__((always_inline)) inline
#define MD_KNOWN(x) __builtin_constant_p(x) /* to the compiler */
#else
#define MD_INLINED inline
#define MD_KNOWN(x) 0
#endif
#define MD_FOLDED MD_INLINED constexpr

MD_FOLDED int32_t md_saturated(int64_t x) { return x > INT32_MAX ? INT32_MAX : x < -INT32_MAX ? -INT32_MAX : (int32_t)x; }
/* A constant in units of 1 / one; the compiler computes it. */
MD_FOLDED int64_t md_units(double x, double one) { return (int64_t)(x * one + (x < 0.0 ? -0.5 : 0.5)); }

/* a * b / 2^25, rounded. */
MD_CALLED int32_t md_multiplied(int32_t a, int32_t b) {
#ifdef __ARM_ARCH_6M__ /* has no product of 64 bits */
  uint32_t low_a = (uint32_t)a & 0xFFFFu, low_b = (uint32_t)b & 0xFFFFu, low = low_a * low_b;
  int32_t high_a = a >> 16, high_b = b >> 16, one = high_a * (int32_t)low_b, other = (int32_t)low_a * high_b;
  uint32_t middle = (low >> 16) + ((uint32_t)one & 0xFFFFu) + ((uint32_t)other & 0xFFFFu);
  int32_t high = high_a * high_b + (one >> 16) + (other >> 16) + (int32_t)(middle >> 16);
  uint32_t rest = middle << 16 | (low & 0xFFFFu), bit = rest >> 24 & 1u;
  if (high >= 1 << 24 || high < -(1 << 24)) return high < 0 ? -INT32_MAX : INT32_MAX;
  uint32_t whole = (uint32_t)high << 7 | rest >> 25;
  return whole == 0x7FFFFFFFu ? INT32_MAX : (int32_t)(whole + bit);
#else
  return md_saturated(((int64_t)a * b + (1 << 24)) >> 25);
#endif
}

/* a * b, whole. */
#ifdef __ARM_ARCH_6M__
MD_CALLED int64_t md_whole(int32_t a, int32_t b) { return (int64_t)a * b; }
#else
static inline int64_t md_whole(int32_t a, int32_t b) { return (int64_t)a * b; }
#endif
/* The same without a call, by what the compiler knows as a half, a quarter, ... or a whole number. */
MD_INLINED bool md_is_simple(int32_t a) { return a > 0 && (a <= 1 << 24 ? !(a & (a - 1)) : a >= 2 << 25 && !(a & ((1 << 25) - 1))); }
MD_INLINED int32_t md_by_simple(int32_t a, int32_t b) {
  if (a >= 2 << 25) return (int32_t)((uint32_t)(a >> 25) * (uint32_t)b);
  return a == 1 << 24 ? (b >> 1) + (b & 1) : ((b >> (24 - __builtin_ctz((unsigned)a))) + 1) >> 1;
}
/* x / y, rounded down. */
#ifdef __ARM_ARCH_6M__ /* cannot divide; the library's division has six times as many bytes */
MD_CALLED uint32_t md_part(uint32_t x, uint32_t y) {
  uint32_t bit = 1, part = 0;
  for (; y < x && (int32_t)y > 0; y <<= 1) bit <<= 1;
  for (; bit; bit >>= 1, y >>= 1)
    if (x >= y) x -= y, part |= bit;
  return part;
}
#else
static inline uint32_t md_part(uint32_t x, uint32_t y) { return x / y; }
#endif
/* The same, as far as it can be told. */
MD_CALLED int32_t md_quotient(uint64_t x, uint32_t y) {
  uint32_t high = (uint32_t)(x >> 32), low = (uint32_t)x;
  if (high >= y >> 1) return INT32_MAX;
  for (int bit = 0; bit < 32; bit++) {
    high = high << 1 | low >> 31, low <<= 1;
    if (high >= y) high -= y, low++;
  }
  return (int32_t)low;
}

/* a * 2^25 / b, rounded towards 0. */
MD_CALLED int32_t md_divided(int32_t a, int32_t b) {
  int32_t size = md_quotient((uint64_t)(a < 0 ? 0u - (uint32_t)a : (uint32_t)a) << 25, b < 0 ? 0u - (uint32_t)b : (uint32_t)b);
  return (a < 0) == (b < 0) ? size : -size;
}

/* The root, rounded down, of less than 2^60. */
MD_CALLED uint32_t md_root(uint64_t x) {
  uint32_t high = (uint32_t)(x >> 32), low = (uint32_t)x, rest = 0, root = 0;
  if (high >> 28) return INT32_MAX;
  for (int bit = 0; bit < 32; bit++) {
    uint32_t odd = root << 2 | 1u;
    rest = rest << 2 | high >> 30, high = high << 2 | low >> 30, low <<= 2, root <<= 1;
    if (rest >= odd) rest -= odd, root++;
  }
  return root;
}

/* Angles, shares, tempos, short times: -64 to 64, in units of 2^-25. */
struct md_real {
  int32_t raw;
  md_real() = default;
  MD_FOLDED md_real(double x) : raw(x >= 64.0 ? INT32_MAX : x <= -64.0 ? -INT32_MAX : (int32_t)md_units(x, 33554432.0)) {}
  MD_FOLDED md_real(float x) : md_real((double)x) {}
  constexpr md_real(int n) : raw(n >= 64 ? INT32_MAX : n <= -64 ? -INT32_MAX : n * 33554432) {}
  static constexpr md_real of(int32_t raw) {
    md_real x(0);
    x.raw = raw;
    return x;
  }
  md_real &operator+=(md_real b) { return *this = *this + b; }
  md_real &operator-=(md_real b) { return *this = *this - b; }
  md_real &operator*=(md_real b) { return *this = *this * b; }
  friend md_real operator-(md_real a) { return of(-a.raw); }
  friend md_real operator+(md_real a, md_real b) { return of((int32_t)((uint32_t)a.raw + (uint32_t)b.raw)); }
  friend md_real operator-(md_real a, md_real b) { return of((int32_t)((uint32_t)a.raw - (uint32_t)b.raw)); }
  friend md_real operator*(md_real a, md_real b) {
    if (MD_KNOWN(a.raw) && md_is_simple(a.raw)) return of(md_by_simple(a.raw, b.raw));
    if (MD_KNOWN(b.raw) && md_is_simple(b.raw)) return of(md_by_simple(b.raw, a.raw));
    return of(md_multiplied(a.raw, b.raw));
  }
  friend md_real operator/(md_real a, md_real b) { return of(md_divided(a.raw, b.raw)); }
  friend bool operator==(md_real a, md_real b) { return a.raw == b.raw; }
  friend bool operator!=(md_real a, md_real b) { return a.raw != b.raw; }
  friend bool operator<(md_real a, md_real b) { return a.raw < b.raw; }
  friend bool operator>(md_real a, md_real b) { return a.raw > b.raw; }
  friend bool operator<=(md_real a, md_real b) { return a.raw <= b.raw; }
  friend bool operator>=(md_real a, md_real b) { return a.raw >= b.raw; }
};

/* Squares and their sums: -8192 to 8192, in units of 2^-50. */
struct md_wide {
  int64_t raw;
  md_wide() = default;
  MD_FOLDED md_wide(float x) : raw(md_units((double)x, 1125899906842624.0)) {}
  static md_wide of(int64_t raw) {
    md_wide x;
    x.raw = raw;
    return x;
  }
  explicit operator md_real() const { return md_real::of(md_saturated((raw + (1 << 24)) >> 25)); }
  md_wide &operator+=(md_wide b) { return *this = *this + b; }
  friend md_wide operator+(md_wide a, md_wide b) { return of(a.raw + b.raw); }
  friend bool operator<(md_wide a, md_wide b) { return a.raw < b.raw; }
  friend bool operator>(md_wide a, md_wide b) { return a.raw > b.raw; }
  friend bool operator<=(md_wide a, md_wide b) { return a.raw <= b.raw; }
};

/* Times into a motion, s: -256 to 256, in units of 2^-23. */
struct md_time {
  int32_t raw;
  md_time() = default;
  MD_FOLDED md_time(float x) : raw((int32_t)md_units((double)x, 8388608.0)) {}
  md_time(md_real x) : raw((x.raw + 2) >> 2) {}
  static md_time of(int32_t raw) {
    md_time x;
    x.raw = raw;
    return x;
  }
  md_time &operator+=(md_time b) { return *this = *this + b; }
  md_time &operator-=(md_time b) { return *this = *this - b; }
  friend md_time operator-(md_time a) { return of(-a.raw); }
  friend md_time operator+(md_time a, md_time b) { return of(a.raw + b.raw); }
  friend md_time operator-(md_time a, md_time b) { return of(a.raw - b.raw); }
  friend bool operator<(md_time a, md_time b) { return a.raw < b.raw; }
  friend bool operator>(md_time a, md_time b) { return a.raw > b.raw; }
  friend bool operator<=(md_time a, md_time b) { return a.raw <= b.raw; }
  friend bool operator>=(md_time a, md_time b) { return a.raw >= b.raw; }
};

MD_CALLED md_real sqrtf(md_real x) { return md_real::of((int32_t)md_root((uint64_t)x.raw << 25)); }
MD_CALLED md_real sqrtf(md_wide x) { return md_real::of(md_saturated((int64_t)md_root((uint64_t)x.raw))); }
static inline md_real fabsf(md_real x) { return x.raw < 0 ? -x : x; }
static inline md_real rounded_down(md_real x) { return md_real::of((int32_t)((uint32_t)x.raw & 0xFE000000u)); }
MD_CALLED md_real rounded(md_real x) { return rounded_down(x + md_real(0.50013f)); }
static inline md_real copysignf(md_real x, md_real sign) { return (x.raw < 0) == (sign.raw < 0) ? x : -x; }

static inline md_time fabsf(md_time x) { return x.raw < 0 ? -x : x; }
static inline md_time bounded(md_time x, md_time low, md_time high) { return x < low ? low : x > high ? high : x; }
MD_CALLED md_wide most(md_wide x, md_wide y) { return y > x ? y : x; }
MD_CALLED md_wide product(md_real x, md_real y) { return md_wide::of(md_whole(x.raw, y.raw)); }
static inline md_wide clearly_less(md_wide cost) { return md_wide::of(cost.raw - (cost.raw >> 10)); }
static inline md_real times(md_real x, int n) { return md_real::of((int32_t)((uint32_t)x.raw * (uint32_t)n)); }
static inline md_real share_of(md_real x, int n) {
  int32_t size = (int32_t)md_part((uint32_t)fabsf(x).raw, (uint32_t)n);
  return md_real::of(x.raw < 0 ? -size : size);
}
static inline md_real times_key(md_real weight, int16_t key) { /* weights are times 2^15 */
  return md_real::of(2 * key * (weight.raw >> 16) + ((key * (int32_t)(weight.raw & 0xFFFF)) >> 15));
}
/* Whole numbers near x and x * n, and k / n; none is negative. */
static inline int nearest(md_real x) { return (int)(((uint32_t)x.raw + (1u << 24)) >> 25); }
static inline int nearest_times(md_real x, int n) { return (int)((md_whole(x.raw, n) + md_units(0.50013, 33554432.0)) >> 25); }
static inline md_real ratio(int k, int n) { return md_real::of(md_quotient((uint64_t)(uint32_t)k << 26, 2u * (uint32_t)n)); }
static inline int whole_ticks(md_real seconds, md_real tick) { return md_quotient((uint64_t)(uint32_t)seconds.raw << 5, (uint32_t)tick.raw); }
/* A tick at a tempo passes; `rest` has what is less than a unit. */
static inline void pass(md_time *x, uint32_t *rest, md_real tick, md_real tempo) {
  uint64_t sum = ((uint64_t)(uint32_t)x->raw << 32 | *rest) + (uint64_t)product(tick, tempo).raw;
  *x = md_time::of((int32_t)(sum >> 32)), *rest = (uint32_t)sum;
}
/* How many times y goes into x and some more, which may be negative, and the share of y that is left. */
static inline int whole_times(md_time x, md_real more, md_real y, md_real *share) {
  int64_t sum = (int64_t)x.raw * 4 + more.raw;
  int n = md_quotient((uint64_t)(sum < 0 ? -sum : sum), (uint32_t)y.raw);
  if (sum < 0) n = -n;
  int32_t rest = (int32_t)((uint32_t)sum - (uint32_t)n * (uint32_t)y.raw);
  if (rest < 0) n--, rest += y.raw;
  *share = md_real::of(rest) / y;
  return n;
}
#endif
