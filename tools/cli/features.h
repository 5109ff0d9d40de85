/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The features of this installation: its modules, each loaded once to see whether the library
 * that it needs is there, and the versions of libraries.
 */
#ifndef INCISE_FEATURES_H
#define INCISE_FEATURES_H

#include <stdbool.h>
#include <stdio.h>

/* A module. */
struct feature {
	char kind[16]; /* "tracker" … as in its file's name, KIND_NAME.so */
	char name[32]; /* "usb" */
	char detail
		[200]; /* "libgpiod 2.2.1", or why it cannot be loaded; "": nothing to say */
	bool usable;
};

/* Call @found for each module, ordered by name. */
void features_each(void (*found)(void *context, const struct feature *feature),
		   void *context);

/* The features that this build leaves out, with their packages: "PNG (libpng-dev), …". */
extern const char features_left_out[];

/*
 * "apt-get install PACKAGES[    # or: pip install PACKAGE]", to be pasted, for a name of lib/base/features.def, until the next
 * call. NULL: it has no row.
 */
const char *features_remedy(const char *name);

/* Print a line for each kind of module, for SQLite and for the view. */
void features_print(FILE *out);

#endif
