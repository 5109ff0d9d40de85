// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/record/frames.c: the module is found where it is, and what is said where it is not.
 */
#include "../unit.h"
#include <limits.h>
#include "../../../lib/record/frames.h"

static const struct incise_frames_shape shape = {32, 16, INCISE_PIXELS_GREY, 60};

TEST(a_module_that_is_not_there_is_said)
{
	char folder[] = "/tmp/incise-frames-XXXXXX", path[100];
	FILE *file;

	assert_non_null(mkdtemp(folder));
	setenv("INCISE_MODULE_PATH", folder, 1);
	errno = 0;
	assert_error(incise_frames_writer_new("/tmp/none.mkv", &shape, NULL, &err),
		     ENOENT, &err, "frames_mkv.so", folder);
	assert_null(incise_frames_reader_new("/tmp/none.mkv", &err));
	assert_int_equal(err.code, ENOENT);

	snprintf(path, sizeof(path), "%s/frames_mkv.so", folder);
	file = fopen(path, "w");
	assert_non_null(file);
	fputs("none\n", file);
	fclose(file);
	assert_error(incise_frames_writer_new("/tmp/none.mkv", &shape, NULL, &err),
		     ENOEXEC, &err, "frames_mkv.so");
	unlink(path);
	rmdir(folder);
	assert_int_equal(access("/tmp/none.mkv", F_OK), -1);
}

TEST(the_module_is_found)
{
	char folder[] = "/tmp/incise-frames-XXXXXX", own[PATH_MAX], path[PATH_MAX + 40];
	struct incise_frames_reader *reader;
	struct incise_frames_writer *writer;
	struct incise_frames_stored stored;
	struct incise_camera_frame frame;
	uint8_t bytes[32 * 16];

	/* O/tests/unit/record/frames, O/lib/incise */
	assert_non_null(realpath("/proc/self/exe", own));
	for (int i = 0; i < 4; i++)
		*strrchr(own, '/') = '\0';
	snprintf(path, sizeof(path), "%s/lib/incise", own);
	setenv("INCISE_MODULE_PATH", path, 1);
	strcat(path, "/frames_mkv.so");
	if (access(path, R_OK)) {
		printf("skipped: frames_mkv.so is not built\n");
		skip();
	}
	assert_non_null(mkdtemp(folder));
	snprintf(path, sizeof(path), "%s/" INCISE_FRAMES_FILE, folder);
	writer = incise_frames_writer_new(path, &shape, NULL, &err);
	succeeds(writer);
	for (size_t i = 0; i < sizeof(bytes); i++)
		bytes[i] = (uint8_t)(i * i);
	frame = (struct incise_camera_frame){
		.t_ns = 5,
		.seq = 6,
		.width = 32,
		.height = 16,
		.stride = 32,
		.pixels = INCISE_PIXELS_GREY,
		.data = bytes,
		.size = sizeof(bytes),
	};
	assert_int_equal(incise_frames_put(writer, &frame, &stored, &err), 0);
	assert_int_equal(incise_frames_writer_close(writer, &err), 0);
	reader = incise_frames_reader_new(path, &err);
	assert_non_null(reader);
	assert_int_equal(incise_frames_next(reader, &frame, &stored, &err), 1);
	assert_int_equal(frame.seq, 6);
	assert_memory_equal(frame.data, bytes, sizeof(bytes));
	assert_int_equal(incise_frames_next(reader, &frame, &stored, &err), 0);
	incise_frames_reader_close(reader);
	incise_frames_reader_close(NULL);
	assert_int_equal(incise_frames_writer_close(NULL, NULL), 0);
	unlink(path);
	rmdir(folder);
}
