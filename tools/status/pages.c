// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The state pages of loops; see pages.h.
 */
#include <dirent.h>
#include <errno.h>
#include <pwd.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "../cli/scene_argument.h"
#include "../cli/state_folder.h"
#include "pages.h"

#define SUFFIX ".state"
#define LOOKS 1000 /* 1 ms apart: the writer may be preempted */

/* Length of NAME in "NAME.state"; 0: another file. */
static size_t name_length(const char *file)
{
	size_t n = strlen(file), end = strlen(SUFFIX);

	return n > end && *file != '.' && !strcmp(file + n - end, SUFFIX) ? n - end : 0;
}

/* The user whose loop it is: free(3). */
static char *user_of(const char *path)
{
	const struct passwd *user;
	struct stat st;

	if (stat(path, &st))
		return cli_text("?");
	user = getpwuid(st.st_uid);
	return user ? cli_text("%s", user->pw_name)
		    : cli_text("%u", (unsigned int)st.st_uid);
}

static void add_pages(struct state_pages *pages, const char *path,
		      struct incise_state *state)
{
	const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
	size_t n = name_length(file);
	struct state_page_file *page;

	pages->page = cli_resize(pages->page, (size_t)pages->n + 1, sizeof(*page));
	page = &pages->page[pages->n++];
	*page = (struct state_page_file){
		.name = cli_text("%.*s", n ? (int)n : (int)strlen(file), file),
		.path = cli_text("%s", path),
		.user = user_of(path),
		.state = state,
	};
	/* Others may name files there: no control characters. */
	for (char *c = page->name; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
}

static int by_name(const void *a, const void *b)
{
	const struct state_page_file *x = a, *y = b;

	return strcmp(x->name, y->name);
}

/* Add all pages of a folder. Returns how many are unreadable. */
static int add_folder(struct state_pages *pages, const char *folder)
{
	DIR *dir = opendir(folder);
	const struct dirent *entry;
	int bad = 0;

	while (dir && (entry = readdir(dir))) {
		struct incise_error err = {0};
		struct incise_state *state;
		char *path;

		if (!name_length(entry->d_name))
			continue;
		path = cli_text("%s/%s", folder, entry->d_name);
		state = incise_state_open(path, &err);
		if (state)
			add_pages(pages, path, state);
		else
			cli_warn("%s", err.text);
		bad += !state;
		free(path);
	}
	if (dir)
		closedir(dir);
	return bad;
}

static void open_all(struct state_pages *pages, char *list[STATE_FOLDERS])
{
	int bad = 0;

	for (int i = 0; i < STATE_FOLDERS; i++)
		if (state_folder_trusted(list, i))
			bad += add_folder(pages, list[i]);
	if (!pages->n && bad)
		cli_fail("no status file of a loop can be read here; see whether they "
			 "belong to another user");
	if (!pages->n)
		cli_fail("no loop has run here; 'incise haptic SCENE' starts one, or "
			 "'systemctl start incise-haptic@NAME' the service");
	qsort(pages->page, (size_t)pages->n, sizeof(*pages->page), by_name);
}

static void open_name(struct state_pages *pages, const char *name,
		      char *list[STATE_FOLDERS])
{
	struct incise_error err = {0};
	bool found = false;

	for (int i = 0; i < STATE_FOLDERS; i++) {
		char *path = state_folder_trusted(list, i)
				     ? cli_text("%s/%s" SUFFIX, list[i], name)
				     : NULL;
		struct incise_state *state = path ? incise_state_open(path, &err) : NULL;

		if (state && pages->n && incise_state_alive(state) != 1) {
			incise_state_close(state);
		} else if (state) {
			state_pages_close(pages);
			add_pages(pages, path, state);
		}
		found |= path && (state || err.code != ENOENT);
		free(path);
		if (pages->n && incise_state_alive(pages->page[0].state) == 1)
			break;
	}
	if (!pages->n && found)
		cli_fail_with(&err);
	if (!pages->n)
		cli_fail("%s: no loop of that name has run here; 'incise haptic %s' "
			 "starts one, 'incise status' shows all",
			 name, name);
}

void state_pages_open(struct state_pages *pages, const char *asked)
{
	struct incise_error err = {0};
	struct incise_state *state;
	char *list[STATE_FOLDERS];
	bool scene = asked && cli_ends_with(asked, ".scene");

	*pages = (struct state_pages){0};
	if (asked && !scene && (strchr(asked, '/') || name_length(asked))) {
		file_expect(asked, FILE_STATE);
		state = cli_require(incise_state_open(asked, &err), &err);
		add_pages(pages, asked, state);
		return;
	}
	state_folders(list);
	if (asked) {
		char *name = scene_argument_name(asked);

		open_name(pages, name, list);
		free(name);
	} else {
		open_all(pages, list);
	}
	state_folders_free(list);
}

int state_pages_try(const struct state_page_file *page, struct incise_state_now *now,
		    struct incise_error *err)
{
	const struct timespec pause = {.tv_nsec = 1000000};
	int rc = -EAGAIN;

	for (int i = 0; i < LOOKS && rc == -EAGAIN; i++) {
		if (i)
			nanosleep(&pause, NULL);
		rc = incise_state_read(page->state, now);
	}
	if (rc == -EAGAIN)
		return incise_error_set(
			err, EAGAIN,
			"%s: incomplete: its loop stopped in the middle of writing it, "
			"or the disk is full; start the loop again",
			page->path);
	if (rc)
		return incise_error_set(err, EIO,
					"%s: damaged or incomplete; start the loop again",
					page->path);
	return 0;
}

void state_pages_look(const struct state_page_file *page, struct incise_state_now *now)
{
	struct incise_error err = {0};

	cli_check(state_pages_try(page, now, &err), &err);
}

void state_pages_close(struct state_pages *pages)
{
	for (int i = 0; i < pages->n; i++) {
		incise_state_close(pages->page[i].state);
		free(pages->page[i].name);
		free(pages->page[i].path);
		free(pages->page[i].user);
	}
	free(pages->page);
	*pages = (struct state_pages){0};
}
