// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Vision, which is in a module of its own, so that only who looks at pictures maps OpenCV;
 * see incise/vision.h.
 *
 * The module is not unloaded: OpenCV leaves in threads that used it what runs when they end.
 */
#include <errno.h>
#include "backends.h"
#include "module.h"

#define KIND "vision"
#define NAME "opencv"

static struct incise_vision *vision_open(const struct incise_vision_setup *setup,
					 struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = "",
		.where = KIND,
		.vision = setup,
	};
	struct incise_loaded loaded;
	int rc = incise_backend_find(&loaded, KIND, NAME, KIND, err);

	if (!rc)
		return loaded.backend->open(&request, err);
	if (rc == -ENODEV)
		rc = incise_module_absent(KIND "_" NAME ".so", KIND,
					  "libopencv-imgproc-dev and libjpeg-dev are",
					  err);
	errno = -rc;
	return NULL;
}

struct incise_vision *incise_vision_new(const struct incise_vision_setup *setup,
					struct incise_error *err)
{
	return vision_open(setup, err);
}

void incise_vision_free(struct incise_vision *vision)
{
	if (vision)
		vision->ops->close(vision);
}

int incise_vision_measure(struct incise_vision *vision,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	return vision->ops->measure(vision, frame, result);
}

int incise_vision_learn(const struct incise_camera_frame *frame,
			const struct incise_vision_box *box,
			struct incise_vision_setup *setup, struct incise_error *err)
{
	/* What is to be learnt need not be valid before. */
	static const struct incise_vision_setup any;
	struct incise_vision *vision = vision_open(&any, err);
	int rc;

	if (!vision)
		return -errno;
	rc = vision->ops->learn(vision, frame, box, setup, err);
	vision->ops->close(vision);
	return rc;
}
