// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The folder and the words of incise demo; see demo.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "../cli/cli.h"
#include "demo.h"

void demo_make_folder(const char *folder, bool may_exist)
{
	if (mkdir(folder, 0777) && (errno != EEXIST || !may_exist))
		cli_fail("%s: %s%s", folder, strerror(errno),
			 errno == EEXIST ? "; give another -o DIR, or --force" : "");
}

char *demo_text(const char *fmt, ...)
{
	va_list args;
	char *s;

	va_start(args, fmt);
	if (vasprintf(&s, fmt, args) < 0)
		cli_fail("no memory");
	va_end(args);
	return s;
}

char *demo_path(const struct demo *demo, const char *name)
{
	return demo_text("%s/%s", demo->folder, name);
}

struct incise_dataset *demo_dataset(const struct demo *demo, const char *name,
				    const char *const *columns, int n, const char *group)
{
	struct incise_error err = {0};
	char *path = demo_path(demo, name);
	struct incise_dataset *data = incise_dataset_read(path, columns, n, group, &err);

	if (!data)
		cli_fail_with(&err);
	free(path);
	return data;
}

struct incise_model *demo_model(const struct demo *demo, const char *name)
{
	struct incise_error err = {0};
	char *path = demo_path(demo, name);
	struct incise_model *model = incise_model_load(path, &err);

	if (!model)
		cli_fail_with(&err);
	free(path);
	return model;
}

void demo_step(const struct demo *demo, const char *what)
{
	static int number;

	if (!demo->quiet)
		printf("\n[%d] %s\n", ++number, what);
}

double demo_number(const json_t *report, const char *a, const char *b)
{
	const json_t *value = json_object_get(report, a);

	return json_number_value(b ? json_object_get(value, b) : value);
}

/* A quantile of the loop's report in us; null there means beyond its histogram. */
char *demo_quantile_us(const json_t *haptic, const char *what, const char *name,
		       double unit)
{
	const json_t *value = json_object_get(json_object_get(haptic, what), name);

	return json_is_number(value)
		       ? demo_text("< %g us", json_number_value(value) * unit)
		       : demo_text("beyond the histogram");
}
