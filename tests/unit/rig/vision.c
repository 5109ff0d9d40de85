// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/vision.c: the module is asked for by its name, every call reaches it with its
 * arguments, and what is said where it is not installed. This file is the finder of modules.
 */
#include "../unit.h"
#include "../../../lib/rig/backends.h"

/* A module that remembers what it was called with. */
static struct {
	int find_rc, open_errno;
	int opened, closed;
	struct incise_vision_setup setup;
	const void *frame, *box, *learnt;
	struct incise_error *err;
} seen;

static int fake_measure(struct incise_vision *vision,
			const struct incise_camera_frame *frame,
			struct incise_vision_result *result)
{
	seen.frame = frame;
	result->length_px = 12;
	return -EBADMSG;
}

static int fake_learn(struct incise_vision *vision,
		      const struct incise_camera_frame *frame,
		      const struct incise_vision_box *box,
		      struct incise_vision_setup *setup, struct incise_error *err)
{
	seen.frame = frame;
	seen.box = box;
	seen.learnt = setup;
	seen.err = err;
	return -ERANGE;
}

static void fake_close(struct incise_vision *vision)
{
	seen.closed++;
}

static void *fake_open(const struct incise_backend_request *request,
		       struct incise_error *err)
{
	static const struct incise_vision_ops ops = {fake_measure, fake_learn,
						     fake_close};
	static struct incise_vision vision = {&ops};

	seen.opened++;
	seen.setup = *request->vision;
	errno = seen.open_errno;
	return seen.open_errno ? NULL : &vision;
}

int incise_backend_find(struct incise_loaded *loaded, const char *kind, const char *name,
			const char *where, struct incise_error *err)
{
	static const struct incise_backend fake = {.open = fake_open};

	assert_string_equal(kind, "vision");
	assert_string_equal(name, "opencv");
	*loaded = (struct incise_loaded){&fake, NULL};
	return seen.find_rc ? incise_error_set(err, -seen.find_rc, "as found") : 0;
}

static int forget(void **state)
{
	memset(&seen, 0, sizeof(seen));
	return setenv("INCISE_MODULE_PATH", "/some/folder", 1);
}

TEST(calls_reach_the_module, forget)
{
	const struct incise_vision_setup setup = {.hue = {3, 4}};
	struct incise_camera_frame frame = {0};
	struct incise_vision_result result = {0};
	struct incise_vision *vision = incise_vision_new(&setup, NULL);

	assert_non_null(vision);
	assert_int_equal(seen.setup.hue[1], 4);
	assert_int_equal(incise_vision_measure(vision, &frame, &result), -EBADMSG);
	assert_ptr_equal(seen.frame, &frame);
	assert_true(result.length_px == 12);
	incise_vision_free(vision);
	assert_int_equal(seen.closed, 1);
	incise_vision_free(NULL);
	assert_int_equal(seen.closed, 1);
}

TEST(learning_needs_no_valid_setup, forget)
{
	struct incise_vision_setup setup = {.hue = {-1, 4000}};
	struct incise_vision_box box = {0};
	struct incise_camera_frame frame = {0};

	assert_int_equal(incise_vision_learn(&frame, &box, &setup, &err), -ERANGE);
	assert_ptr_equal(seen.frame, &frame);
	assert_ptr_equal(seen.box, &box);
	assert_ptr_equal(seen.learnt, &setup);
	assert_ptr_equal(seen.err, &err);
	assert_int_equal(seen.setup.hue[0], 0);
	assert_int_equal(seen.opened, 1);
	assert_int_equal(seen.closed, 1);
}

TEST(what_it_refuses_comes_back, forget)
{
	const struct incise_vision_setup setup = {0};

	seen.open_errno = EINVAL;
	assert_null(incise_vision_new(&setup, NULL));
	assert_int_equal(errno, EINVAL);
}

TEST(a_module_that_is_not_there_is_said, forget)
{
	static const struct {
		int found, code;
		const char *says;
	} row[] = {
		{-ENODEV, ENOENT, "vision: no module vision_opencv.so in /some/folder; "},
		{-ENOEXEC, ENOEXEC, "as found"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		struct incise_vision_setup setup = {0};
		struct incise_error err = {0};

		seen.find_rc = row[i].found;
		errno = 0;
		assert_null(incise_vision_new(&setup, &err));
		assert_int_equal(errno, row[i].code);
		assert_int_equal(err.code, row[i].code);
		assert_says(err.text, row[i].says);
		assert_int_equal(incise_vision_learn(NULL, NULL, &setup, &err),
				 -row[i].code);
	}
	assert_int_equal(seen.opened, 0);
}
