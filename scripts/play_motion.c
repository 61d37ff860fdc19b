/* Reads motion.csv (mjxgait export RUN --out motion.csv) and sends each joint's target at its time.
 *
 *     cc -O2 scripts/play_motion.c -o play_motion && ./play_motion motion.csv
 *
 * Replace `send` by your robot's call: PD control with the gains of creature.toml follows the targets.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define COLUMNS 256

static void send(double time, const char *joint, double target) { printf("%.3f %s %.5f\n", time, joint, target); }

int main(int count, char **given) {
    static char line[65536], heads[65536];
    char *names[COLUMNS] = {0};
    int columns = 0;
    double last = 0.0;
    FILE *file = count > 1 ? fopen(given[1], "r") : NULL;
    if (!file || !fgets(heads, sizeof heads, file)) return fprintf(stderr, "play_motion: no motion to read\n"), 2;
    for (char *name = strtok(heads, ",\r\n"); name && columns < COLUMNS; name = strtok(NULL, ",\r\n")) names[columns++] = name;
    while (fgets(line, sizeof line, file)) {
        char *rest = line;
        for (int i = 0; i < columns; i++) {
            double value = strtod(rest, &rest);
            if (*rest == ',') rest++;
            if (i == 0 && count < 3) { /* in real time, unless a second argument is given */
                struct timespec wait = {0, (long)(1e9 * (value - last))};
                nanosleep(&wait, NULL);
            }
            if (i == 0) last = value;
            char *end = strstr(names[i], "_target");
            if (end && !end[7]) send(last, names[i], value);
        }
    }
    return fclose(file);
}
