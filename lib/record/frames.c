// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Pictures in a file: finding the module that does it; see frames.h.
 *
 * It is not unloaded: libavcodec leaves in threads that used it what runs when they end.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "frames.h"

#define FILE_NAME "frames_mkv.so"

/* INCISE_MODULE_PATH, or incise/ beside this library; as that of devices. */
static bool find_folder(char *path, size_t size)
{
	const char *given = secure_getenv("INCISE_MODULE_PATH");
	char own[PATH_MAX];
	Dl_info info;
	int length;

	if (given && *given) {
		length = snprintf(path, size, "%s", given);
		return length > 0 && (size_t)length < size;
	}
	if (!dladdr((void *)incise_frames_writer_new, &info) || !info.dli_fname ||
	    !realpath(info.dli_fname, own) || !strrchr(own, '/'))
		return false;
	*strrchr(own, '/') = '\0';
	length = snprintf(path, size, "%s/incise", own);
	return length > 0 && (size_t)length < size;
}

static const struct incise_frames_module *load(struct incise_error *err)
{
	const struct incise_frames_module *module;
	char in[PATH_MAX], path[PATH_MAX + 40];
	bool has_folder = find_folder(in, sizeof(in));
	void *handle;

	snprintf(path, sizeof(path), "%s/" FILE_NAME, has_folder ? in : "");
	if (!has_folder || access(path, R_OK)) {
		incise_error_set(err, ENOENT,
				 "camera: there is no module " FILE_NAME
				 " in %.300s; build and install incise where "
				 "libavformat-dev and libavcodec-dev are, or set "
				 "INCISE_MODULE_PATH",
				 has_folder ? in : "any folder");
		return NULL;
	}
	handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
	if (!handle) {
		incise_error_set(err, ENOEXEC,
				 "camera: the module cannot be loaded: %.300s; install "
				 "what it needs",
				 dlerror());
		return NULL;
	}
	module = dlsym(handle, INCISE_FRAMES_SYMBOL);
	if (module && module->abi == INCISE_FRAMES_ABI)
		return module;
	dlclose(handle);
	incise_error_set(err, ENOEXEC,
			 "camera: %.300s: is not made for this version of incise; build "
			 "it again",
			 path);
	return NULL;
}

struct incise_frames_writer *incise_frames_writer_new(
	const char *path, const struct incise_frames_shape *shape,
	const struct incise_frames_options *options, struct incise_error *err)
{
	const struct incise_frames_module *module = load(err);

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
	const struct incise_frames_module *module = load(err);

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
