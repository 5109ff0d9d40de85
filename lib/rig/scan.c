// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Looking for devices behind a backend; see incise/scan.h.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/scan.h>
#include "../base/module.h"
#include "../base/monotonic.h"
#include "backends.h"
#include "haptic_page.h"

/* Adds the kind to each device that a backend finds. */
struct kind_found {
	const char *kind;
	incise_scan_found *found;
	void *context;
	int rc; /* last return of found */
};

static int pass_on(void *context, const struct incise_scan_device *device)
{
	struct incise_scan_device copy = *device;
	struct kind_found *of = context;

	snprintf(copy.kind, sizeof(copy.kind), "%s", of->kind);
	return of->rc = of->found(of->context, &copy);
}

static int scan_backend(struct kind_found *of, const char *name)
{
	struct incise_scan_device failed = {0};
	struct incise_error err = {0};
	char spec[40];
	int rc;

	snprintf(spec, sizeof(spec), "%.31s:", name);
	rc = incise_scan(of->kind, spec, of->found, of->context, &err);
	/* It cannot search, or not without arguments. */
	if (!err.code || rc == -EOPNOTSUPP || rc == -EINVAL)
		return err.code ? 0 : rc;
	snprintf(failed.kind, sizeof(failed.kind), "%s", of->kind);
	snprintf(failed.device, sizeof(failed.device), "%s", spec);
	snprintf(failed.what, sizeof(failed.what), "%.239s", err.text);
	return of->found(of->context, &failed);
}

static const char *const kinds[] = {"tracker", "force", "camera", "haptic", "stepper"};
#define KINDS (sizeof(kinds) / sizeof(*kinds))
#define NAMES 16

/* The backend of that name, of any kind. */
static int find_any(struct incise_loaded *loaded, struct kind_found *of, const char *name,
		    const char *where, struct incise_error *err)
{
	char names[NAMES][32], known[KINDS * NAMES * 34] = "sim", module[80];
	const char *kind = kinds[0]; /* one that a build may have by that name */
	int rc = -ENODEV;

	for (size_t k = 0; k < KINDS && rc == -ENODEV; k++) {
		int n = incise_backend_names(kinds[k], names, NAMES);

		snprintf(module, sizeof(module), "%s_%.40s", kinds[k], name);
		if (incise_module_packages(module))
			kind = kinds[k];
		of->kind = kinds[k];
		rc = incise_backend_find(loaded, kinds[k], name, where, err);
		for (int i = 0; i < n; i++) {
			size_t used = strlen(known);

			snprintf(known + used, sizeof(known) - used, ", %s", names[i]);
		}
	}
	return rc == -ENODEV ? incise_backend_absent(kind, name, where, known, err) : rc;
}

#define PAGES "/dev/shm"
#define PAGE "incise-"

/* A page of this user, which somebody's own process serves; its owner may have died. */
static int scan_page(const char *name, incise_scan_found *found, void *context)
{
	struct incise_scan_device device = {.kind = "haptic"};
	struct incise_haptic_page page;
	struct haptic_page opened;
	struct stat st = {0};
	char path[300];
	ssize_t size = 0;

	snprintf(path, sizeof(path), PAGES "/%.255s", name);
	opened.fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	if (opened.fd >= 0) {
		if (!fstat(opened.fd, &st) && st.st_uid == geteuid())
			size = pread(opened.fd, &page, sizeof(page), 0);
		device.usable =
			incise_haptic_page_held(&opened, INCISE_HAPTIC_PAGE_OWNER_BYTE);
		close(opened.fd);
	}
	if (size != sizeof(page) ||
	    memcmp(page.head.magic, INCISE_HAPTIC_PAGE_MAGIC, sizeof(page.head.magic)) ||
	    strncmp(page.device.device, HAPTIC_PAGE_LOCAL, strlen(HAPTIC_PAGE_LOCAL)))
		return 0;
	device.usable &= incise_monotonic_ns() - page.owner.heartbeat_ns <
			 INCISE_HAPTIC_PAGE_DEAD_NS;
	snprintf(device.device, sizeof(device.device), "%.255s", page.device.device);
	snprintf(device.what, sizeof(device.what), "%.63s%s", page.device.name,
		 device.usable ? "" : ": its owner has died; start it again");
	return found(context, &device);
}

static int scan_pages(incise_scan_found *found, void *context)
{
	DIR *folder = opendir(PAGES);
	struct dirent *entry;
	int rc = 0;

	while (folder && !rc && (entry = readdir(folder)))
		if (!strncmp(entry->d_name, PAGE, strlen(PAGE)))
			rc = scan_page(entry->d_name, found, context);
	if (folder)
		closedir(folder);
	return rc;
}

/* Each backend of each kind that needs no arguments, and the pages. */
static int scan_all(incise_scan_found *found, void *context)
{
	char names[NAMES][32];
	int rc = 0;

	for (size_t k = 0; k < KINDS && !rc; k++) {
		struct kind_found of = {kinds[k], found, context, 0};
		int n = incise_backend_names(kinds[k], names, NAMES);

		for (int i = 0; i < n && !rc; i++)
			rc = scan_backend(&of, names[i]);
	}
	return rc ? rc : scan_pages(found, context);
}

int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
		void *context, struct incise_error *err)
{
	struct incise_loaded loaded = {0};
	struct kind_found of = {kind, found, context, 0};
	char name[32], where[80];
	size_t length;
	int rc = 0;

	if (!spec)
		return scan_all(found, context);
	length = strcspn(spec, ":");
	if (!spec[length] || length >= sizeof(name))
		return incise_error_set(err, EINVAL,
					"%.60s: expected BACKEND:ARGUMENTS such as "
					"can:can0; correct it",
					spec);
	snprintf(name, sizeof(name), "%.*s", (int)length, spec);
	snprintf(where, sizeof(where), "%.70s", spec);
	/* The virtual rig is there for every kind. */
	if (strcmp(name, "sim"))
		rc = kind ? incise_backend_find(&loaded, kind, name, where, err)
			  : find_any(&loaded, &of, name, where, err);
	if (rc)
		return rc;
	if (!found)
		rc = 0;
	else if (loaded.backend && loaded.backend->scan)
		rc = loaded.backend->scan(spec + length + 1, pass_on, &of, err);
	else
		rc = incise_error_set(err, EOPNOTSUPP,
				      "%s: this backend cannot search for devices; "
				      "name yours in rig.conf",
				      where);
	incise_backend_unload(&loaded);
	return rc;
}

void incise_scan_tell(struct incise_scan_device *device, const char *key,
		      const char *format, ...)
{
	struct incise_scan_property *property;
	va_list args;

	if (device->n >= INCISE_SCAN_PROPERTIES)
		return;
	property = &device->property[device->n++];
	property->key = key;
	va_start(args, format);
	vsnprintf(property->text, sizeof(property->text), format, args);
	va_end(args);
}
