// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * In place of lib/rig/backends.c, for programs that have vision's module linked into
 * them: lib/rig/vision.c finds it here.
 */
#include "../../lib/rig/backends.h"
#include "../../lib/vision/vision_opencv.h"

int incise_backend_find(struct incise_loaded *loaded, const char *kind, const char *name,
			const char *where, struct incise_error *err)
{
	static const struct incise_backend linked = {.open = vision_opencv_open};

	(void)kind;
	(void)name;
	(void)where;
	(void)err;
	*loaded = (struct incise_loaded){&linked, NULL};
	return 0;
}
