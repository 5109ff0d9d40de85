// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise info BACKEND:BUS: who is on a bus, and what to write into rig.conf for it.
 */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/scan.h>
#include "bus_report.h"
#include "../cli/cli.h"
#include "../cli/json.h"

/* A device, with keys that stay when the backend's module is gone. */
struct answer {
	char kind[16], device[320], what[240];
	bool usable;
	int n;
	struct {
		char key[40], text[100];
	} property[INCISE_SCAN_PROPERTIES];
};

/* All of them, in the order in which they answered. */
struct found {
	struct answer *answer;
	int n;
};

bool bus_report_is(const char *what)
{
	static const char *const files[] = {".fis", ".fx", ".rec", ".rec/"};
	size_t n = strspn(what, "abcdefghijklmnopqrstuvwxyz0123456789_");

	if (!n || what[n] != ':')
		return false;
	n = strlen(what);
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		if (n > strlen(files[i]) &&
		    !strcmp(what + n - strlen(files[i]), files[i]))
			return false;
	return true;
}

static int keep(void *context, const struct incise_scan_device *device)
{
	struct found *found = context;
	struct answer *more, *one;

	more = reallocarray(found->answer, (size_t)found->n + 1, sizeof(*more));
	if (!more)
		return -ENOMEM;
	found->answer = more;
	one = &more[found->n++];
	*one = (struct answer){0};
	snprintf(one->kind, sizeof(one->kind), "%s", device->kind);
	snprintf(one->device, sizeof(one->device), "%s", device->device);
	snprintf(one->what, sizeof(one->what), "%s", device->what);
	one->usable = device->usable;
	for (; one->n < device->n && one->n < INCISE_SCAN_PROPERTIES; one->n++) {
		const struct incise_scan_property *from = &device->property[one->n];

		snprintf(one->property[one->n].key, sizeof(one->property->key), "%s",
			 from->key);
		snprintf(one->property[one->n].text, sizeof(one->property->text), "%s",
			 from->text);
	}
	return 0;
}

/* A drive gives its own name: what it says must not reach the terminal as commands. */
static void put_plain(const char *text)
{
	for (; *text; text++)
		putchar(iscntrl((unsigned char)*text) ? '?' : *text);
}

static void put_device(const struct answer *device)
{
	int width = (int)strlen(device->kind);

	for (int i = 0; i < device->n; i++)
		if ((int)strlen(device->property[i].key) > width)
			width = (int)strlen(device->property[i].key);
	putchar('\n');
	put_plain(device->what);
	putchar('\n');
	if (device->usable) {
		printf("  %-*s = \"", width, device->kind);
		put_plain(device->device);
		fputs("\";\n", stdout);
	}
	for (int i = 0; i < device->n; i++) {
		printf("  %-*s   ", width, device->property[i].key);
		put_plain(device->property[i].text);
		putchar('\n');
	}
}

static json_t *device_json(const struct answer *device)
{
	json_t *object = json_pack("{ss so so sb}", "kind", device->kind, "device",
				   json_text(device->device), "what",
				   json_text(device->what), "usable", device->usable);

	for (int i = 0; i < device->n; i++)
		json_object_set_new(object, device->property[i].key,
				    json_text(device->property[i].text));
	return object;
}

static void show_json(const char *kind, const char *bus, const struct found *found)
{
	json_t *report = json_pack("{ss}", "kind", kind), *devices = json_array();

	for (int i = 0; i < found->n; i++)
		json_array_append_new(devices, device_json(&found->answer[i]));
	if (bus)
		json_object_set_new(report, "bus", json_text(bus));
	json_object_set_new(report, "devices", devices);
	json_print(report);
}

static void put_all(const char *what, const struct found *found)
{
	printf("%s: %d device%s\n", what, found->n, found->n == 1 ? "" : "s");
	for (int i = 0; i < found->n; i++)
		put_device(&found->answer[i]);
}

/* Backends that could not look are no devices: their lines go to who has to mend them. */
static void warn_of_failed(struct found *found)
{
	int n = 0;

	for (int i = 0; i < found->n; i++) {
		const struct answer *one = &found->answer[i];
		size_t length = strlen(one->device);

		if (one->usable || one->n || !length || one->device[length - 1] != ':')
			found->answer[n++] = *one;
		else
			cli_warn("%s", one->what);
	}
	found->n = n;
}

void bus_report_show_attached(bool json)
{
	struct found found = {0};
	int rc;

	cli_progress("looking for devices");
	rc = incise_scan(NULL, NULL, keep, &found, NULL);
	cli_progress_end();
	if (rc)
		cli_fail("devices: %s", strerror(-rc));
	warn_of_failed(&found);
	if (json)
		show_json("devices", NULL, &found);
	else if (found.n)
		put_all("attached", &found);
	else
		puts("no tracker, force channel, camera or stepper is attached; drives on a "
		     "CAN bus are listed by `incise info can:can0`");
	free(found.answer);
}

void bus_report_show(const char *what, bool json)
{
	struct incise_error err = {0};
	struct found found = {0};
	int rc;

	cli_progress("looking on %s", what);
	rc = incise_scan(NULL, what, keep, &found, &err);
	cli_progress_end();
	if (rc == -ENOMEM && !err.code)
		cli_fail("%s: no memory for what was found", what);
	if (rc)
		cli_fail_with(&err);
	/* As with a word that names no file: who asks for it expects it to be there. */
	if (!found.n)
		cli_fail(
			"%s: nobody answers; see that it has power and its cable is in; on a "
			"bus its node id, bit rate and the two ends of 120 ohm",
			what);
	if (json) {
		show_json("bus", what, &found);
	} else {
		put_all(what, &found);
	}
	free(found.answer);
}
