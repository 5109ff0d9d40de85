/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The C interfaces of this module: its entry point, and the JPEG decoder.
 */
#ifndef INCISE_VISION_OPENCV_H
#define INCISE_VISION_OPENCV_H

#include <incise/backend.h>
#include <incise/camera.h>
#include <incise/vision.h>

INCISE_BEGIN_DECLS

/* For struct incise_backend: a struct incise_vision. */
void *vision_opencv_open(const struct incise_backend_request *request,
			 struct incise_error *err);

/*
 * Decode the part *@area of a JPEG frame, which is within its sizes, to rows of frame->width RGB
 * pixels at @rgb, with capacity for area->height of them. *@area is widened on both sides to
 * whole blocks. Rows below it are not read. The data are not trusted.
 *
 * Returns 0; -EBADMSG, -EINVAL (other sizes than the frame's), -ENOMEM.
 */
int incise_jpeg_decode(const struct incise_camera_frame *frame,
		       struct incise_vision_box *area, uint8_t *rgb);

INCISE_END_DECLS
#endif
