// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of incise/origin.h: tokens against a table written by hand, found in other bytes and files,
 * and each single change of one.
 */
#include "../unit.h"
#include <incise/origin.h>

#define A "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"

static const struct {
	struct incise_origin origin;
	const char *text;
} good[] = {
	{{1, "recording", A, 97, "4e1b-02", "liver.rec"},
	 "incise:1:recording:" A ":97:4e1b-02:liver.rec;"},
	{{9, "export", A, 0, "", "a b;:%\n\"<\xc3\xa9.csv"},
	 "incise:9:export:" A ":0:-:a%20b%3B%3A%25%0A%22%3C%C3%A9.csv;"},
	{{2, "model", A, UINT64_MAX, "", "~_-.x"},
	 "incise:2:model:" A ":18446744073709551615:-:~_-.x;"},
};

#define GOOD (sizeof(good) / sizeof(*good))

static void assert_same(const struct incise_origin *a, const struct incise_origin *b)
{
	assert_int_equal(a->depth, b->depth);
	assert_string_equal(a->kind, b->kind);
	assert_string_equal(a->sha256, b->sha256);
	assert_int_equal(a->commit, b->commit);
	assert_string_equal(a->identity, b->identity);
	assert_string_equal(a->name, b->name);
}

TEST(tokens_are_those_of_the_table)
{
	for (size_t i = 0; i < GOOD; i++) {
		char text[INCISE_ORIGIN_TEXT];
		struct incise_origin found;
		size_t at = 0;

		assert_int_equal(incise_origin_text(&good[i].origin, text),
				 strlen(good[i].text));
		assert_string_equal(text, good[i].text);
		assert_true(incise_origin_next(text, strlen(text), &at, &found));
		assert_int_equal(at, strlen(text));
		assert_same(&found, &good[i].origin);
		assert_false(incise_origin_next(text, strlen(text), &at, &found));
	}
}

TEST(the_longest_one_fits)
{
	struct incise_origin origin = {
		INCISE_ORIGIN_DEPTH_MAX, "abcdefghijklmno", A, UINT64_MAX, A, ""};
	char text[INCISE_ORIGIN_TEXT];

	memset(origin.name, '\n', sizeof(origin.name) - 1);
	assert_in_range(incise_origin_text(&origin, text), 1, sizeof(text) - 1);
}

TEST(what_is_no_origin_is_refused)
{
	const struct incise_origin bad[] = {
		{0, "recording", A, 0, "", "x"},  {10, "recording", A, 0, "", "x"},
		{1, "", A, 0, "", "x"},		  {1, "Model", A, 0, "", "x"},
		{1, "model", "0123", 0, "", "x"}, {1, "model", A, 0, "a:b", "x"},
		{1, "model", A, 0, "-", "x"},	  {1, "model", A, 0, "", ""},
		{1, "model", A, 0, "", "a/b"},	  {1, "model", A, 0, "", ".."},
	};
	char text[INCISE_ORIGIN_TEXT];

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
		assert_int_equal(incise_origin_text(&bad[i], text), -EINVAL);
}

/* Among zeros, other tokens that are none, and starts of one. */
TEST(tokens_are_found_in_any_bytes)
{
	static const char bytes[] =
		"\0\xff incise:incise:1:recording:" A ":97:4e1b-02:liver.rec;"
		"incise:1:recording:" A ":97:x:a/b;incise:1:model:" A ":0:-:m%41.fis;"
		"incise:1:model:" A ":00:-:m.fis;incise:1:model:" A ":0:-:..;"
		"\0incise:2:model:" A ":18446744073709551615:-:~_-.x;incise:1:model:" A
		":0:-:cut";
	struct incise_origin found;
	size_t at = 0;

	assert_true(incise_origin_next(bytes, sizeof(bytes) - 1, &at, &found));
	assert_same(&found, &good[0].origin);
	assert_true(incise_origin_next(bytes, sizeof(bytes) - 1, &at, &found));
	assert_same(&found, &good[2].origin);
	assert_false(incise_origin_next(bytes, sizeof(bytes) - 1, &at, &found));
}

/* A changed byte, or a missing end, is another token that is well formed, or none. */
TEST(changed_tokens_are_others_or_none)
{
	for (size_t i = 0; i < GOOD; i++) {
		size_t n = strlen(good[i].text);

		for (size_t k = 0; k < n; k++)
			for (int byte = 0; byte < 256; byte++) {
				char *text =
					malloc(n); /* its end is that of the memory */
				char again[INCISE_ORIGIN_TEXT];
				struct incise_origin found;
				size_t at = 0;

				memcpy(text, good[i].text, n);
				text[k] = (char)byte;
				if (incise_origin_next(text, n, &at, &found))
					assert_int_equal(incise_origin_text(&found,
									    again),
							 (int)n - (int)(n - at));
				at = 0;
				assert_false(
					incise_origin_next(good[i].text, k, &at, &found));
				free(text);
			}
	}
}

static void write_text(const char *path, const char *text)
{
	FILE *file = fopen(path, "w");

	assert_non_null(file);
	fputs(text, file);
	fclose(file);
}

TEST(a_file_is_added_with_what_it_was_made_of)
{
	struct incise_origin origin = {.depth = 1, .kind = "recording", .commit = 97};
	char path[] = "/tmp/incise-origin-XXXXXX", token[INCISE_ORIGIN_TEXT], text[3000];
	struct incise_origins origins = {0};
	struct incise_error err = {0};
	int fd = mkstemp(path);

	assert_true(fd >= 0);
	close(fd);
	memset(origin.sha256, 'a', 64);
	strcpy(origin.identity, "0123");
	strcpy(origin.name, "liver.rec");
	assert_true(incise_origin_text(&origin, token) > 0);
	/* Said twice, in a file of any form. */
	snprintf(text, sizeof(text), "# %s\n# incise:1:bad;\n%s,1,2\n", token, token);
	write_text(path, text);
	assert_int_equal(incise_origins_read(&origins, path, false, &err), 0);
	assert_int_equal(origins.n, 1);
	assert_same(&origins.all[0], &origin);
	incise_origins_free(&origins);

	assert_int_equal(incise_origins_add(&origins, path, "table", &err), 0);
	assert_int_equal(origins.n, 2);
	assert_string_equal(origins.all[0].kind, "table");
	assert_string_equal(origins.all[0].name, path + 5);
	assert_int_equal(origins.all[0].depth, 1);
	origin.depth = 2;
	assert_same(&origins.all[1], &origin);
	incise_origins_free(&origins);

	unlink(path);
	assert_int_equal(incise_origins_read(&origins, path, false, &err), -ENOENT);
	/* A pipe, say, is gone by then. */
	assert_int_equal(incise_origins_add(&origins, path, "table", &err), 0);
	assert_int_equal(origins.n, 0);
}
