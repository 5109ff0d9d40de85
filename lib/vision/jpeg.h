/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Part of a JPEG picture as RGB. Cameras are not trusted: anything may be in there.
 */
#ifndef INCISE_JPEG_H
#define INCISE_JPEG_H

#include <incise/camera.h>
#include <incise/vision.h>

INCISE_BEGIN_DECLS

/*
 * Decode what is in *@area, which is within the frame's sizes, to rows of frame->width
 * pixels at @rgb, which holds area->height of them; *@area comes back wider, to both sides,
 * where whole blocks ask for it. Rows below it are not looked at.
 *
 * Returns 0; -EBADMSG, -EINVAL (other sizes than the frame's), -ENOMEM.
 */
int incise_jpeg_decode(const struct incise_camera_frame *frame,
		       struct incise_vision_box *area, uint8_t *rgb);

INCISE_END_DECLS
#endif
