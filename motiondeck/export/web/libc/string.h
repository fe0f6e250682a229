/* What the player takes of <string.h>: instructions of WebAssembly's bulk memory. */
#include <stddef.h>
#define memcpy __builtin_memcpy
#define memset __builtin_memset
