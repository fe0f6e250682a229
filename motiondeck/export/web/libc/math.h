/* What the player takes of <math.h>: instructions of WebAssembly. */
#define sqrtf __builtin_sqrtf
#define fabsf __builtin_fabsf
#define copysignf __builtin_copysignf
