/* An algorithm under test for `host-sim rehearse --with`: docs/rehearse.md has the lines.
 *
 * Dead reckoning: it goes on from the last fix with its velocity, level and along the track. Put
 * your own filter in its place. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EARTH_RADIUS_M 6371000.0
#define DEG (3.14159265358979323846 / 180.0)

static double position[3]; /* latitude and longitude, deg, height, m */
static double velocity[3]; /* north, east, down, m/s */

/* Turned by theta (rad) and pushed by dv (m/s), forward-right-down, over dt. */
static void on_imu(double dt, const double theta[3], const double dv[3])
{
    double degrees = dt / EARTH_RADIUS_M / DEG;
    (void)theta;
    (void)dv;
    position[0] += velocity[0] * degrees;
    position[1] += velocity[1] * degrees / cos(position[0] * DEG);
    position[2] -= velocity[2] * dt;
}

/* What the fix does not have is NaN. */
static void on_gnss(const double *fix)
{
    if (!isnan(fix[0]) && !isnan(fix[2]))
        memcpy(position, fix, sizeof position);
    if (!isnan(fix[3])) {
        memcpy(velocity, fix + 3, sizeof velocity);
        if (isnan(velocity[2]))
            velocity[2] = 0.0;
    }
}

/* Fields after the first comma; an empty one is NaN. */
static int split(const char *line, double *numbers, int most)
{
    int count = 0;
    while (count < most && (line = strchr(line, ',')) != NULL) {
        char *end;
        numbers[count] = strtod(++line, &end);
        if (end == line)
            numbers[count] = NAN;
        count++;
    }
    return count;
}

int main(void)
{
    char line[1024];
    while (fgets(line, sizeof line, stdin) != NULL) {
        double n[16];
        split(line, n, 16);
        if (strncmp(line, "start,", 6) == 0) {
            memcpy(position, n + 1, sizeof position);
            memcpy(velocity, n + 4, sizeof velocity);
            printf("ready,1\n");
        } else if (strncmp(line, "imu,", 4) == 0) {
            on_imu(n[1], n + 2, n + 5);
        } else if (strncmp(line, "gnss,", 5) == 0) {
            on_gnss(n + 1);
        } else if (strncmp(line, "ask,", 4) == 0) {
            line[strcspn(line, "\n")] = '\0'; /* "none,%s" while there is no solution */
            printf("solution,%s,%.10f,%.10f,%.4f,%.5f,%.5f,%.5f,0,0,%.5f\n", line + 4,
                   position[0], position[1], position[2], velocity[0], velocity[1], velocity[2],
                   atan2(velocity[1], velocity[0]) / DEG);
        } else if (strncmp(line, "end", 3) == 0) {
            break;
        }
        fflush(stdout);
    }
    return 0;
}
