/* What the player takes of <math.h>: instructions of WebAssembly, all but the cube root, which is in wasm.c. */
#define sqrtf __builtin_sqrtf
#define floorf __builtin_floorf
#define ceilf __builtin_ceilf
#define rintf __builtin_rintf
#define fabsf __builtin_fabsf
#define copysignf __builtin_copysignf
float cbrtf(float);
