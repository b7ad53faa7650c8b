/* The loops of finite elements as one translation unit. */
#include "cells.c"
#include "elastic.c"
