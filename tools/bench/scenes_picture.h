/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The picture of incise bench scenes: time and instructions of a tick, each scene over its
 * full pipeline.
 */
#ifndef INCISE_SCENES_PICTURE_H
#define INCISE_SCENES_PICTURE_H

#include "machine.h"
#include "scene_row.h"

void scenes_picture(const struct scene_row *rows, int n, const struct machine *machine,
		    const char *folder, const char *name);

#endif
