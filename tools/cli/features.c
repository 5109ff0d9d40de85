// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The features of this installation; see features.h.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <incise/backend.h>
#include <incise/error.h>
#include "../../lib/publish/formats.h"
#include "cli.h"
#include "features.h"

/* The text that a function of a loaded library returns, or NULL. */
static const char *text_of_features(void *handle, const char *function)
{
	const char *(*call)(void) = (const char *(*)(void))dlsym(handle, function);

	return call ? call() : NULL;
}

static void try(struct feature *feature, const char *path)
{
	void *handle = dlopen(path, RTLD_LAZY | RTLD_LOCAL);
	struct incise_error err = {0};
	const char *gpiod;

	feature->usable = handle;
	if (!handle) {
		incise_error_library(&err, feature->name, dlerror());
		snprintf(feature->detail, sizeof(feature->detail), "%.199s",
			 err.text + strcspn(err.text, ":") + 2 * !!strchr(err.text, ':'));
		return;
	}
	/* By the names of libgpiod 2 and 1. */
	gpiod = text_of_features(handle, "gpiod_api_version");
	gpiod = gpiod ? gpiod : text_of_features(handle, "gpiod_version_string");
	if (gpiod && !strcmp(feature->name, "gpio"))
		snprintf(feature->detail, sizeof(feature->detail), "libgpiod %.20s",
			 gpiod);
	dlclose(handle);
}

static int is_module(const struct dirent *entry)
{
	return strchr(entry->d_name, '_') && cli_ends_with(entry->d_name, ".so") &&
	       strncmp(entry->d_name, "peer_", 5);
}

void features_each(void (*found)(void *context, const struct feature *feature),
		   void *context)
{
	char folder[PATH_MAX], path[PATH_MAX + 300];
	struct dirent **entries = NULL;
	int n = incise_module_folder(folder, sizeof(folder))
			? scandir(folder, &entries, is_module, alphasort)
			: 0;

	for (int i = 0; i < n; i++) {
		struct feature feature = {.usable = false};
		const char *name = entries[i]->d_name, *end = strchr(name, '_');

		snprintf(feature.kind, sizeof(feature.kind), "%.*s", (int)(end - name),
			 name);
		snprintf(feature.name, sizeof(feature.name), "%.*s", (int)strlen(end) - 4,
			 end + 1);
		snprintf(path, sizeof(path), "%s/%s", folder, name);
		try(&feature, path);
		found(context, &feature);
		free(entries[i]);
	}
	free(entries);
}

const char features_left_out[] = LEFT_OUT;

const char *features_remedy(const char *name)
{
	static const char *const features[][3] = {
#define FEATURE(names, apt, pip) {" " names " ", apt, pip},
#include "../../lib/base/features.def"
	};
	static char remedy[200];
	char word[80];

	snprintf(word, sizeof(word), " %.70s ", name);
	for (size_t i = 0; i < sizeof(features) / sizeof(*features); i++)
		if (strstr(features[i][0], word)) {
			snprintf(remedy, sizeof(remedy), "apt-get install %s%s%s",
				 features[i][1],
				 *features[i][2] ? "    # or: pip install " : "",
				 features[i][2]);
			return remedy;
		}
	return NULL;
}

/* --- a line for each kind --- */

#define FORMAT_NAME(id, ...) ", " #id
#define NO_FORMAT(...)

static const struct {
	const char *kind, *label, *built_in;
} kinds[] = {
	{"tracker", "trackers", ""},
	{"force", "force", ""},
	{"haptic", "haptic", ""},
	{"camera", "cameras", ""},
	{"stepper", "steppers", ""},
	{"driver", "chips", ""},
	{"vision", "vision", ""},
	{"board", "chessboard", ""},
	{"frames", "frames", ""},
	{"film", "video", ""},
	{"export", "export", &INCISE_FORMATS(FORMAT_NAME, NO_FORMAT)[2]},
	{"outlet", "outlets", ""},
	{"ranks", "parallel", ""},
};

#define KINDS (sizeof(kinds) / sizeof(*kinds))

struct lines {
	char text[KINDS][600];
};

static void add_features(void *context, const struct feature *feature)
{
	struct lines *lines = context;

	for (size_t i = 0; i < KINDS; i++) {
		char *text = lines->text[i];
		size_t used = strlen(text);

		if (!strcmp(kinds[i].kind, feature->kind))
			snprintf(text + used, sizeof(lines->text[i]) - used, "%s%s%s%s%s",
				 *text ? ", " : "", feature->name,
				 *feature->detail ? " (" : "", feature->detail,
				 *feature->detail ? ")" : "");
	}
}

/* The first line of the reason why a library cannot be loaded, or what its function returns. */
static void print_library(FILE *out, const char *label, const char *library,
			  const char *function)
{
	void *handle = dlopen(library, RTLD_LAZY | RTLD_LOCAL);
	const char *text = handle && function ? text_of_features(handle, function) : NULL;

	fprintf(out, "  %-11s%s\n", label, text ? text : handle ? "yes" : "no");
	if (handle)
		dlclose(handle);
}

void features_print(FILE *out)
{
	static struct lines lines;
	char folder[PATH_MAX];

	for (size_t i = 0; i < KINDS; i++)
		snprintf(lines.text[i], sizeof(lines.text[i]), "%s", kinds[i].built_in);
	features_each(add_features, &lines);
	for (size_t i = 0; i < KINDS; i++)
		fprintf(out, "  %-11s%s\n", kinds[i].label,
			*lines.text[i] ? lines.text[i] : "none");
	print_library(out, "sqlite", RECORD_LIBRARY, "sqlite3_libversion");
	print_library(out, "view", VIEW_LIBRARY, NULL);
	if (*features_left_out)
		fprintf(out, "  %-11s%s\n", "left out", features_left_out);
	if (incise_module_folder(folder, sizeof(folder)))
		fprintf(out, "  %-11s%s\n", "modules", folder);
}
