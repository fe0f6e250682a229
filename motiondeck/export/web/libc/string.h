/* What the player takes of <string.h>: instructions of WebAssembly's bulk memory, and two functions in wasm.c. */
#include <stddef.h>
#define memcpy __builtin_memcpy
#define memmove __builtin_memmove
#define memset __builtin_memset
size_t strlen(const char *);
int strcmp(const char *, const char *);
