import type { LevelData, LevelReady, Model, StreamInfo, ViewStats } from "./pmesh.js";

export type { LevelData, LevelReady, Model, StreamInfo, ViewStats };

/** What a model that is refined where it is looked at has, and what it took. */
export interface RefineDetail extends ViewStats {
  splitsPerSecond: number;
  connected: boolean;
  connections: number;
  /** Nothing changes any more until the camera moves. */
  settled: boolean;
}

/** An orbit camera: angles in radians, zoom 1 fits the model. */
export class OrbitCamera {
  yaw: number;
  pitch: number;
  zoom: number;
  turn(yaw: number, pitch: number): void;
  scale(factor: number): void;
  reset(): void;
}

export interface PMeshElementEventMap extends HTMLElementEventMap {
  /** A level has arrived; canceled, it shows only after update(). */
  levelready: CustomEvent<LevelReady>;
  levelchange: CustomEvent<{ level: number; triangles: number }>;
  /** Bytes have arrived (replaces the element's inherited event of that name). */
  progress: CustomEvent<{ bytes: number; totalBytes: number | null }> & ProgressEvent;
  /** A model that is refined where it is looked at has changed. */
  refine: CustomEvent<RefineDetail>;
  load: CustomEvent<null>;
  error: CustomEvent<{ code: string; message: string }> & ErrorEvent;
}

/** A 3D model that shows at once and sharpens while it arrives. */
export class PMeshElement extends HTMLElement {
  /** Triangles that all elements of the page may draw together. */
  static triangleBudget: number;
  src: string;
  /** Level to show: 0 is the finest, fractions morph; null shows the newest. */
  level: number | null;
  maxTriangles: number | null;
  /** Pixels of geometric error allowed. */
  autoLevel: number | null;
  /** src is a file that is refined where it is looked at. */
  viewDependent: boolean;
  /** Pixels that what is seen may be off by (models that are refined where they are looked at). */
  screenError: number | null;
  /** Megabytes of memory for such a model. */
  maxMemory: number | null;
  /** Such a model stays as it is while the camera moves on. */
  frozen: boolean;
  cameraControls: boolean;
  autoRotate: boolean;
  wireframe: boolean;
  background: string;
  alt: string;
  poster: string;
  loading: "eager" | "lazy" | "";
  debug: "" | "representatives" | boolean | null;
  readonly info: StreamInfo | null;
  readonly shownLevel: number | null;
  readonly levelCount: number;
  readonly bytes: number;
  readonly complete: boolean;
  readonly model: Model | null;
  readonly viewStats: RefineDetail | null;
  camera: OrbitCamera;
  /** Throws a RangeError if level is not a number or null. */
  setLevel(level: number | null): void;
  addLevel(data: LevelData): Promise<LevelReady>;
  update(): void;
  pause(): void;
  play(): void;
  toBlob(type?: string, quality?: number): Promise<Blob>;
  requestRender(): void;
  addEventListener<K extends keyof PMeshElementEventMap>(
    type: K, listener: (this: PMeshElement, event: PMeshElementEventMap[K]) => unknown, options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "p-mesh": PMeshElement;
  }
}
