/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * This room as C sees it: what libincise asks of the module, in incise/vision.h's words.
 */
#ifndef INCISE_VISION_OPENCV_H
#define INCISE_VISION_OPENCV_H

#include <incise/backend.h>

INCISE_BEGIN_DECLS

/* Of struct incise_backend: a struct incise_vision. */
void *vision_opencv_open(const struct incise_backend_request *request,
			 struct incise_error *err);

/* Of struct incise_vision_ops. @vision is not looked at. */
int vision_opencv_learn(struct incise_vision *vision,
			const struct incise_camera_frame *frame,
			const struct incise_vision_box *box,
			struct incise_vision_setup *setup, struct incise_error *err);

INCISE_END_DECLS
#endif
