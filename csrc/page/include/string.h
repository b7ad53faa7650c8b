/* What the march takes from string.h: instructions of WebAssembly. */
#include <stddef.h>
#define memcmp __builtin_memcmp
#define memcpy __builtin_memcpy
#define memset __builtin_memset
