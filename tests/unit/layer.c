// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * One program for all tests of a layer: to link one for each file took longer than to run them. The
 * main() of tests/unit/LAYER/NAME.c is compiled as unit_NAME(), and a symbolic link NAME to this
 * program runs it.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

int main(int argc, char **argv)
{
	const char *slash = strrchr(argv[0], '/');
	char symbol[256];
	int (*run)(void);

	snprintf(symbol, sizeof(symbol), "unit_%s", slash ? slash + 1 : argv[0]);
	run = (int (*)(void))dlsym(RTLD_DEFAULT, symbol);
	if (run && argc == 1)
		return run();
	fprintf(stderr, "%s: run a test by its own name, without arguments\n", argv[0]);
	return 2;
}
