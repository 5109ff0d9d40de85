/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A picture file as a frame of a camera: PNG, JPEG, PGM and PPM of 8 bits, by what is in it
 * and not by its name.
 */
#ifndef INCISE_DEPTH_PICTURE_H
#define INCISE_DEPTH_PICTURE_H

#include <incise/camera.h>

/* Read it; fails the program with the file's name. frame->data is to be freed. */
void depth_picture_read(const char *path, struct incise_camera_frame *frame);

#endif
