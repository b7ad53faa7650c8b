/* The loops of finite elements as one translation unit. */
#include "elastic.c"
