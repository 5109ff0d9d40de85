/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A replay as a picture: predicted beside measured force, and depth, over time. A long one
 * is drawn from every so many ticks, so that the picture of an hour is as quick as any.
 */
#ifndef INCISE_REPLAY_PICTURE_H
#define INCISE_REPLAY_PICTURE_H

#include <stdio.h>
#include <incise/replay.h>

struct replay_picture {
	const char *folder, *name;
	char file[80]; /* of the data */
	FILE *data;
	int drawn; /* of REPLAY_PICTURE_POINTS, the last; -1: none */
};

#define REPLAY_PICTURE_POINTS 20000

/* Where --plot says; fails the program when that cannot be. */
void replay_picture_begin(struct replay_picture *picture, const char *path);

void replay_picture_add(struct replay_picture *picture,
			const struct incise_replay_tick *told);

/* Draw NAME.png and .svg; fails the program when that cannot be. */
void replay_picture_draw(struct replay_picture *picture);

#endif
