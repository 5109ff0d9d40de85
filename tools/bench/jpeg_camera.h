/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A camera that gives JPEG pictures, as USB cameras do: those of a virtual camera, coded
 * before and given over and over, so that drawing and coding them is no part of what is
 * measured. For incise bench.
 */
#ifndef INCISE_JPEG_CAMERA_H
#define INCISE_JPEG_CAMERA_H

#include <incise/camera.h>
#include <incise/clock.h>
#include <incise/error.h>

struct jpeg_camera;

/* Code pictures of the rig's script. NULL with errno ENOMEM, EOPNOTSUPP (built without). */
struct jpeg_camera *jpeg_camera_new(double rate_hz, struct incise_error *err);
void jpeg_camera_free(struct jpeg_camera *camera);

/* Have a rig's camera give them from now on, by this clock; until it is closed. */
void jpeg_camera_take_over(struct jpeg_camera *camera, struct incise_camera *of_rig,
			   struct incise_clock *clock);

/* Bytes of all its pictures, and how many they are. */
size_t jpeg_camera_bytes(const struct jpeg_camera *camera, int *n);

#endif
