// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Frames in a file: loads the module that writes and reads it; see frames.h.
 *
 * The module is not unloaded: libavcodec leaves destructors in the threads that used it.
 */
#include <errno.h>
#include <sys/stat.h>
#include "../base/module.h"
#include "frames.h"

static const struct incise_frames_module *load_frames(struct incise_error *err)
{
	return incise_module_load("frames_mkv.so", INCISE_FRAMES_SYMBOL,
				  INCISE_FRAMES_ABI, "camera", err);
}

struct incise_frames_writer *incise_frames_writer_new(
	const char *path, const struct incise_frames_shape *shape,
	const struct incise_frames_options *options, struct incise_error *err)
{
	const struct incise_frames_module *module = load_frames(err);

	return module ? module->create(path, shape, options, err) : NULL;
}

int incise_frames_put(struct incise_frames_writer *writer,
		      const struct incise_camera_frame *frame,
		      struct incise_frames_stored *stored, struct incise_error *err)
{
	return writer->ops->put(writer, frame, stored, err);
}

int incise_frames_writer_close(struct incise_frames_writer *writer,
			       struct incise_error *err)
{
	return writer ? writer->ops->close(writer, err) : 0;
}

struct incise_frames_reader *incise_frames_reader_new(const char *path,
						      struct incise_error *err)
{
	const struct incise_frames_module *module = load_frames(err);
	struct stat st;

	/* libavformat would wait for a pipe. */
	if (!stat(path, &st) && !S_ISREG(st.st_mode))
		return INCISE_ERROR_NULL(err, EINVAL, "%.300s: not a regular file", path);
	return module ? module->open(path, err) : NULL;
}

int incise_frames_next(struct incise_frames_reader *reader,
		       struct incise_camera_frame *frame,
		       struct incise_frames_stored *stored, struct incise_error *err)
{
	return reader->ops->next(reader, frame, stored, err);
}

void incise_frames_reader_close(struct incise_frames_reader *reader)
{
	if (reader)
		reader->ops->close(reader);
}
