// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The folder of a report; see report_folder.h.
 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/outfile.h>
#include "../cli/cli.h"
#include "document.h"
#include "../cli/folder.h"
#include "../cli/json.h"
#include "report_document.h"
#include "report_folder.h"

static const char *const parts[] = {"data", "pictures", "report.json", "report.html",
				    "report.md"};
#define PARTS (int)(sizeof(parts) / sizeof(*parts))

static char *in(const char *folder, const char *name)
{
	char *path;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		cli_fail("no memory");
	return path;
}

static void remove_all(const char *path)
{
	int rc = folder_remove(path);

	if (rc && rc != -ENOENT)
		cli_fail("%s: cannot be removed: %s", path, strerror(-rc));
}

static void make(const char *path)
{
	if (mkdir(path, 0777))
		cli_fail("%s: %s", path, strerror(errno));
}

/* A report, or one that was never finished; or nothing at all. */
static bool may_be_replaced(const char *path)
{
	DIR *folder = opendir(path);
	struct dirent *entry;
	bool empty = true, report = false;

	if (!folder)
		cli_fail("%s: %s", path, strerror(errno));
	while ((entry = readdir(folder))) {
		char *file = in(path, entry->d_name);
		json_t *json;

		if (!strcmp(entry->d_name, "report.json")) {
			json = json_read(file, NULL);
			report = json_is_object(json_object_get(json, "words"));
			json_decref(json);
		}
		free(file);
		empty &= *entry->d_name == '.' &&
			 (!strcmp(entry->d_name, ".") || !strcmp(entry->d_name, "..") ||
			  !strcmp(entry->d_name, ".unfinished"));
	}
	closedir(folder);
	return empty || report;
}

/* Folders above it that are missing. */
static void make_above(const char *path)
{
	char *above = strdup(path);

	if (!above)
		cli_fail("no memory");
	for (char *slash = strchr(above + 1, '/'); slash;
	     slash = strchr(slash + 1, '/')) {
		*slash = 0;
		if (mkdir(above, 0777) && errno != EEXIST)
			cli_fail("%s: %s", above, strerror(errno));
		*slash = '/';
	}
	free(above);
}

void report_folder_begin(struct report_folder *folder, const char *path)
{
	char *part;

	*folder = (struct report_folder){.path = path,
					 .unfinished = in(path, ".unfinished")};
	make_above(path);
	folder->made = !mkdir(path, 0777);
	if (!folder->made && errno != EEXIST)
		cli_fail("%s: %s", path, strerror(errno));
	if (!folder->made && !may_be_replaced(path))
		cli_fail("%s: is there, and is no report; give another --report DIR",
			 path);
	remove_all(folder->unfinished);
	make(folder->unfinished);
	for (int i = 0; i < 2; i++) {
		part = in(folder->unfinished, parts[i]);
		make(part);
		free(part);
	}
}

void report_folder_finish(struct report_folder *folder)
{
	for (int i = 0; i < PARTS; i++) {
		char *from = in(folder->unfinished, parts[i]),
		     *to = in(folder->path, parts[i]);

		remove_all(to);
		if (rename(from, to))
			cli_fail("%s: %s", to, strerror(errno));
		free(from);
		free(to);
	}
	remove_all(folder->unfinished);
	free(folder->unfinished);
}

void report_folder_abandon(struct report_folder *folder)
{
	remove_all(folder->unfinished);
	if (folder->made)
		rmdir(folder->path);
	free(folder->unfinished);
}

json_t *report_folder_load(const char *path)
{
	char *file = in(path, "report.json");
	struct incise_error err = {0};
	json_t *report = json_read(file, &err);

	if (!report)
		cli_fail_with(&err);
	if (!json_is_object(json_object_get(report, "words")))
		cli_fail("%s: is no report of 'incise bench all'", file);
	free(file);
	return report;
}

/* Begin a part under another name; NULL and the reason. */
static struct incise_outfile *open_part(const char *folder, const char *name,
					struct incise_error *err)
{
	char *path = in(folder, name);
	struct incise_outfile *file = incise_outfile_open(path, err);

	free(path);
	return file;
}

static int write_json(const char *path, const json_t *report, struct incise_error *err)
{
	struct incise_outfile *file = open_part(path, "report.json", err);

	if (!file)
		return -errno;
	json_dumpf(report, incise_outfile_stream(file),
		   JSON_INDENT(1) | JSON_REAL_PRECISION(12));
	fputc('\n', incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

static int write_html(const char *path, const struct document *document,
		      struct incise_error *err)
{
	struct incise_outfile *file = open_part(path, "report.html", err);
	int rc;

	if (!file)
		return -errno;
	rc = document_html(document, path, incise_outfile_stream(file), err);
	if (!rc)
		return incise_outfile_commit(file, err);
	incise_outfile_abort(file);
	return rc;
}

static int write_markdown(const char *path, const struct document *document,
			  struct incise_error *err)
{
	struct incise_outfile *file = open_part(path, "report.md", err);

	if (!file)
		return -errno;
	document_markdown(document, incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

/* Documents are of what a reader of report.json gets, rounded as it is. */
int report_folder_write(const char *path, const json_t *report, struct incise_error *err)
{
	struct document *document;
	json_t *read;
	int rc = write_json(path, report, err);

	if (rc)
		return rc;
	read = report_folder_load(path);
	document = report_document(read, path);
	rc = write_html(path, document, err);
	if (!rc)
		rc = write_markdown(path, document, err);
	document_free(document);
	json_decref(read);
	return rc;
}
