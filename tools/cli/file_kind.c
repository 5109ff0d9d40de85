// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The kind of a file, by its content; see file_kind.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/rig.h>
#include <incise/scene.h>
#include "../../lib/publish/formats.h"
#include "cli.h"
#include "file_kind.h"

#define HEAD_MOST 65536 /* bytes that are looked at */

#define LETTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"

/* In the order of their bits: a name with its article, and what to do with such a file. */
static const struct {
	const char *name, *extension;
	const char *hint; /* %1$s in it is the path */
} kinds[FILE_KINDS] = {
	{"a recording", ".rec", "'incise info %1$s' describes it"},
	{"a model (.fis)", ".fis",
	 "'incise info %1$s' describes it, 'incise eval %1$s' runs it"},
	{"a compiled model (.fx)", ".fx",
	 "'incise info %1$s' describes it, 'incise eval %1$s' runs it"},
	{"a compiled scene (.plan)", ".plan", "'incise info %1$s' describes it"},
	{"a scene", ".scene", "'incise plan %1$s' shows what it runs"},
	{"the configuration of a rig", NULL, "name it with --rig %1$s"},
	{"a calibration", NULL, "'incise calibrate check --calibration %1$s' shows it"},
	{"a CSV table (separated by commas)", ".csv",
	 "'incise train' learns from one, 'incise calibrate KIND --from' reads readings"},
	{"a session", ".session", "'incise assess %1$s' evaluates it"},
	{"a JSON report", ".json",
	 "'incise bench compare OLD.json NEW.json' compares reports of benchmarks"},
	{"the status file of a loop", ".state", "'incise status %1$s' shows it"},
	{"the standard deviation of a model (.sd)", ".sd",
	 "give its model; 'incise eval MODEL.fis --uncertainty total' reads both"},
	{"an image", NULL,
	 "'incise calibrate depth two-point --from %1$s' measures in images"},
	{"a video", NULL, "give the recording that it belongs to"},
	{"an export of a recording", NULL, "give the recording that it was made from"},
	{"a database", NULL, "give the folder of the recording that it is in"},
	{"a table separated by semicolons", ".csv",
	 "convert it, and decimal commas with it: sed 's/,/./g; s/;/,/g' %1$s > NEW.csv"},
	{"a table separated by tabs", ".csv",
	 "convert it: tr '\\t' ',' < %1$s > NEW.csv"},
	{"a factor (.fac)", ".fac",
	 "'incise info %1$s' describes it, 'incise merge' makes a model of factors"},
	{"the texture of a model (.tex)", ".tex", "'incise info %1$s' describes it"},
};

/* The command that makes one kind from another. */
static const struct {
	enum file_kind found;
	unsigned int expected;
	const char *hint;
} steps[] = {
	{FILE_RECORDING, FILE_TABLE,
	 "make a dataset of it: 'incise export %1$s -o DATA.csv'"},
	{FILE_RECORDING, FILE_MODEL | FILE_COMPILED,
	 "learn a model from it: 'incise train %1$s -o MODEL.fis'"},
	{FILE_TABLE, FILE_MODEL | FILE_COMPILED,
	 "learn a model from it: 'incise train %1$s -o MODEL.fis'"},
	{FILE_MODEL, FILE_COMPILED, "compile it: 'incise compile %1$s -o MODEL.fx'"},
	{FILE_MODEL, FILE_SCENE, "give a scene, and the model with --model %1$s"},
	{FILE_COMPILED, FILE_SCENE, "give a scene, and the model with --model %1$s"},
	{FILE_COMPILED, FILE_MODEL, "give the .fis file that it was compiled from"},
	{FILE_FACTOR, FILE_MODEL | FILE_COMPILED,
	 "make a model of it: 'incise merge %1$s -o MODEL.fis'"},
	{FILE_PLAN, FILE_SCENE, "give the scene that it was compiled from"},
};

/* The libconfig file that has this key at its top level, if only one kind has. */
static enum file_kind kind_of_key(const char *key, size_t length)
{
	char *name = cli_text("%.*s", (int)length, key);
	enum file_kind kind = (incise_rig_has_key(name) ? FILE_RIG : 0) |
			      (incise_scene_has_key(name) ? FILE_SCENE : 0) |
			      (incise_calibration_has_key(name) ? FILE_CALIBRATION : 0);

	free(name);
	return kind & (kind - 1) ? FILE_UNKNOWN : kind;
}

/* Behind a comment of libconfig at @c, or a string; @c itself where there is neither. */
static const char *skip_quiet(const char *c)
{
	const char *end;

	if (*c == '#' || !strncmp(c, "//", 2))
		return c + strcspn(c, "\n");
	if (!strncmp(c, "/*", 2)) {
		end = strstr(c + 2, "*/");
		return end ? end + 2 : c + strlen(c);
	}
	if (*c != '"')
		return c;
	for (c++; *c && *c != '"'; c++)
		c += *c == '\\' && c[1];
	return c + (*c == '"');
}

/* A file of libconfig, by the first of its top-level keys that only one kind has. */
static enum file_kind kind_of_settings(const char *text)
{
	enum file_kind kind = FILE_UNKNOWN;
	int depth = 0;

	for (const char *c = text; *c && !kind;) {
		const char *next = skip_quiet(c);
		size_t length = strspn(c, LETTERS "_");

		if (next != c) {
			c = next;
			continue;
		}
		if (length && !depth) {
			const char *behind = c + length + strspn(c + length, " \t\n");

			if (*behind == '=' || *behind == ':')
				kind = kind_of_key(c, length);
		}
		depth += !!strchr("{[(", *c) - !!strchr("}])", *c);
		c += length ? length : 1;
	}
	return kind;
}

/* The number of these separators in the line at @text. */
static int separators(const char *text, char separator)
{
	int n = 0;

	for (; *text && *text != '\n'; text++)
		n += *text == separator;
	return n;
}

/* By the separator of which the first two rows that are no comment have as many, if any. */
static enum file_kind kind_of_table(const char *text)
{
	static const struct {
		char separator;
		enum file_kind kind;
	} known[] = {{';', FILE_SEMICOLONS}, {'\t', FILE_TABS}, {',', FILE_TABLE}};
	const char *second;

	while (*text == '#' || *text == '\n' || *text == '\r') {
		text += strcspn(text, "\n");
		text += *text == '\n';
	}
	/* KEY = VALUE; of libconfig, with a key that nobody knows. */
	if (separators(text, '='))
		return FILE_UNKNOWN;
	second = strchr(text, '\n');
	for (size_t i = 0; i < sizeof(known) / sizeof(*known); i++) {
		int n = separators(text, known[i].separator);

		if (n && (!second || !second[1] ||
			  separators(second + 1, known[i].separator) == n))
			return known[i].kind;
	}
	return FILE_UNKNOWN;
}

static enum file_kind kind_of_text(const char *text)
{
	enum file_kind kind;

	text += strspn(text, " \t\r\n");
	/* The notes of a model may be longer than what is looked at. */
	if (!strncmp(text, "% incise: ", 10))
		return FILE_MODEL;
	/* The comments of a model; those of a file of libconfig begin with '#' too. */
	while (*text == '%' || *text == '#') {
		text += strcspn(text, "\n");
		text += strspn(text, " \t\r\n");
	}
	if (!strncmp(text, "[System]", 8))
		return FILE_MODEL;
	if (*text == '{')
		return strstr(text, "\"incise_session\"") ? FILE_SESSION : FILE_REPORT;
	if (!strncmp(text, "incise-sd ", 10))
		return FILE_DEVIATION;
	if (!strncmp(text, "incise-tex ", 11))
		return FILE_TEXTURE;
	kind = kind_of_settings(text);
	return kind ? kind : kind_of_table(text);
}

static enum file_kind kind_of_bytes(const char *head, size_t n)
{
	static const struct {
		enum file_kind kind;
		const char *magic;
	} magics[] = {
		{FILE_COMPILED, "INCISEFX"},
		{FILE_PLAN, "INCISEPL"},
		{FILE_STATE, "INCSTATE"},
		{FILE_FACTOR, "incise factor "},
		{FILE_VIDEO, "\x1a\x45\xdf\xa3"},
#define EXPORT(id, name, extensions, magic, ...) {FILE_EXPORT, magic},
		INCISE_FORMATS(EXPORT, EXPORT){FILE_IMAGE, "\x89PNG"},
		{FILE_IMAGE, "\xff\xd8\xff"},
		{FILE_IMAGE, "P5\n"},
		{FILE_IMAGE, "P6\n"},
		{FILE_DATABASE, "SQLite format 3"},
	};

	for (size_t i = 0; i < sizeof(magics) / sizeof(*magics); i++) {
		size_t length = strlen(magics[i].magic);

		if (length && n >= length && !memcmp(head, magics[i].magic, length))
			return magics[i].kind;
	}
	if (memchr(head, 0, n))
		return FILE_UNKNOWN;
	return kind_of_text(n >= 3 && !memcmp(head, "\xef\xbb\xbf", 3) ? head + 3 : head);
}

static bool is_recording(const char *path)
{
	char *file = cli_text("%s/recording.db", path);
	bool is = !access(file, F_OK);

	free(file);
	return is;
}

char *file_without_choice(const char *path)
{
	char *whole = cli_text("%s", path), *slash = strrchr(whole, '/');
	char *colon = strrchr(slash ? slash : whole, ':');

	if (!colon || !access(path, F_OK))
		return whole;
	*colon = 0;
	if (!is_recording(whole))
		*colon = ':';
	return whole;
}

enum file_kind file_kind_of(const char *path)
{
	enum file_kind kind = FILE_UNKNOWN;
	struct stat st;
	char *head;
	int fd;
	ssize_t n;

	if (stat(path, &st)) {
		head = file_without_choice(path);
		if (strcmp(head, path))
			kind = file_kind_of(head);
		free(head);
		return kind;
	}
	if (S_ISDIR(st.st_mode))
		return is_recording(path) ? FILE_RECORDING : FILE_UNKNOWN;
	if (!S_ISREG(st.st_mode))
		return FILE_UNKNOWN;
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
	if (fd < 0)
		return FILE_UNKNOWN;
	head = cli_alloc(HEAD_MOST + 1, 1);
	n = read(fd, head, HEAD_MOST);
	if (n > 0)
		kind = kind_of_bytes(head, (size_t)n);
	free(head);
	close(fd);
	return kind;
}

/* "a session, a model (.fis) or a compiled model (.fx)": free(3). */
static char *names_of(unsigned int expected)
{
	char *text = cli_text("%s", "");

	for (int i = 0; i < FILE_KINDS; i++) {
		bool last = !(expected >> i >> 1);
		char *before = text;

		if (!(expected & 1u << i))
			continue;
		text = cli_text("%s%s%s", before,
				!*before ? ""
				: last	 ? " or "
					 : ", ",
				kinds[i].name);
		free(before);
	}
	return text;
}

static const char *hint_of(enum file_kind found, unsigned int expected)
{
	int bit = 0;

	for (size_t i = 0; i < sizeof(steps) / sizeof(*steps); i++)
		if (steps[i].found == found && steps[i].expected & expected)
			return steps[i].hint;
	while (found != 1u << bit)
		bit++;
	return kinds[bit].hint;
}

/* The text with each "%1$s" replaced by the path: free(3). */
static char *with_path(const char *hint, const char *path)
{
	char *text = cli_text("%s", "");

	for (const char *from = hint, *at;; from = at + 4) {
		char *before = text;

		at = strstr(from, "%1$s");
		text = cli_text("%s%.*s%s", before,
				(int)(at ? at - from : (long)strlen(from)), from,
				at ? path : "");
		free(before);
		if (!at)
			return text;
	}
}

static char *stem_of(const char *name)
{
	const char *dot = strrchr(name, '.');

	return cli_text("%.*s", dot ? (int)(dot - name) : (int)strlen(name), name);
}

static bool is_near(const char *name, const char *other)
{
	return incise_nearest_name(name, (const char *const[]){other, NULL});
}

/* "pairs.cvs" and "pairs" for "pairs.csv", but not "bad.fis" for "red.fis". */
static bool meant(const char *typed, const char *name)
{
	char *stem = stem_of(name), *typed_stem = stem_of(typed);
	bool is = !strcmp(typed, stem) ||
		  (is_near(typed, name) && is_near(typed_stem, stem));

	free(stem);
	free(typed_stem);
	return is;
}

/* A file next to @path whose name is near, with its folder: free(3); NULL: there is none. */
static char *near(const char *path, unsigned int expected)
{
	char *pattern = cli_text("%.*s*", (int)(basename(path) - path), path);
	char *found = NULL;
	glob_t files;

	if (!glob(pattern, 0, NULL, &files)) {
		for (size_t i = 0; i < files.gl_pathc && !found; i++)
			if (meant(basename(path), basename(files.gl_pathv[i])) &&
			    file_kind_of(files.gl_pathv[i]) & expected)
				found = cli_text("%s", files.gl_pathv[i]);
		globfree(&files);
	}
	free(pattern);
	return found;
}

/* Whether there is no file, and no recording that was interrupted either. */
static bool is_missing(const char *path)
{
	char *part = cli_text("%s.part", path), *whole = file_without_choice(path);
	bool missing =
		*path && access(whole, F_OK) && errno == ENOENT && access(part, F_OK);

	free(whole);
	free(part);
	return missing;
}

void file_expect(const char *path, unsigned int expected)
{
	enum file_kind found = file_kind_of(path);
	char *other;

	if (!strcmp(path, "-") || found & expected)
		return;
	if (found)
		cli_fail("%s: this is %s, not %s; %s", path, names_of(found),
			 names_of(expected), with_path(hint_of(found, expected), path));
	other = is_missing(path) ? near(path, expected) : NULL;
	if (other)
		cli_fail("%s: no such file; did you mean %s?", path, other);
}

const char *file_operand(const char *path, enum file_kind expected)
{
	int bit = 0;
	char *whole;

	while (expected != 1u << bit)
		bit++;
	whole = cli_text("%s%s", path, kinds[bit].extension);
	if (is_missing(path) && !is_missing(whole)) {
		cli_input(whole);
		path = whole;
	} else {
		free(whole);
	}
	file_expect(path, expected);
	return path;
}
